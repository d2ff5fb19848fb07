"""``python -m thermofast``; the installed ``thermofast`` script is the documented way."""

from .main import run

if __name__ == "__main__":
    run()
