"""Names the packages and builds the compiled loops; without a compiler thermofast runs their numpy twins."""

from typing import Any

from Cython.Build import cythonize
from setuptools import Extension, find_packages, setup

#: What is being worked on: the next tag.
NEXT = "0.4.0"


def version(found: Any) -> str:
    """The tag's own version, else the next one's with the count of commits since the last tag."""
    return str(found.tag) if found.exact else f"{NEXT}.dev{found.distance or 0}"


FLAGS = ["-O3", "-fno-math-errno"]
#: Folder at the top -> name it is installed under.
FOLDERS = {"thermofast_cli": "thermofast", "models": "thermofast.models", "filters": "thermofast.filters"}

EXTENSIONS = cythonize(
    [
        Extension("thermofast.models.core._lump", ["models/core/_lump.pyx"], extra_compile_args=FLAGS),
        Extension("thermofast.models.core._tails", ["models/core/_tails.pyx"], extra_compile_args=FLAGS),
        Extension(
            "thermofast.models.imperfection._mixture",
            ["models/imperfection/_mixture.pyx"],
            extra_compile_args=[*FLAGS, "-ffp-contract=off"],  # the same numbers on processors of every width
        ),
        Extension("thermofast.models.core._forward", ["models/core/_forward.pyx"], extra_compile_args=FLAGS),
        Extension("thermofast.filters._loop", ["filters/_loop.pyx"], extra_compile_args=FLAGS),
    ]
)
for extension in EXTENSIONS:
    extension.optional = True  # said to cythonize it is lost

setup(
    use_scm_version={
        "version_scheme": version,
        "local_scheme": "no-local-version",
        "fallback_version": f"{NEXT}.dev0",
        "version_file": "thermofast_cli/_version.py",
        "version_file_template": '"""Written when the package is built, from the last tag."""\n\n__version__ = "{version}"\n',
    },
    packages=[name + suffix for folder, name in FOLDERS.items() for suffix in ["", *("." + p for p in find_packages(folder))]],
    ext_modules=EXTENSIONS,
)
