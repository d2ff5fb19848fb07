"""Names the packages and builds the compiled loops; without a compiler thermofast runs their numpy twins."""

from Cython.Build import cythonize
from setuptools import Extension, find_packages, setup

FLAGS = ["-O3", "-fno-math-errno"]
#: Folder at the top -> name it is installed under.
FOLDERS = {"thermofast_cli": "thermofast", "models": "thermofast.models", "filters": "thermofast.filters"}

setup(
    packages=[name + suffix for folder, name in FOLDERS.items() for suffix in ["", *("." + p for p in find_packages(folder))]],
    ext_modules=cythonize(
        [
            Extension("thermofast.models.core._lump", ["models/core/_lump.pyx"], extra_compile_args=FLAGS, optional=True),
            Extension("thermofast.models.core._tails", ["models/core/_tails.pyx"], extra_compile_args=FLAGS, optional=True),
            Extension(
                "thermofast.models.imperfection._mixture",
                ["models/imperfection/_mixture.pyx"],
                extra_compile_args=FLAGS,
                optional=True,
            ),
            Extension("thermofast.models.core._forward", ["models/core/_forward.pyx"], extra_compile_args=FLAGS, optional=True),
            Extension("thermofast.filters._loop", ["filters/_loop.pyx"], extra_compile_args=FLAGS, optional=True),
        ]
    ),
)
