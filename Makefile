# Short verbs. Everything happens in .venv; nothing else on the machine is touched.
# LOCKED=1 installs the versions of constraints.txt, with which the suite was last run, instead of the newest that are allowed.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed

.PHONY: help demo test coverage check audit site dist bench proof docs clean

demo: $(STAMP)  ## install, run the main job on a sample run, say where the pictures are
	@mkdir -p out
	$(BIN)/thermofast identify sample_runs/spindle.csv --until 60 --format table --save-plot out/spindle.png
	$(BIN)/thermofast sweep --windows 40,45,50,55 sample_runs/spindle.csv --channels T5 --format table -q --save-plot out/sweep.png
	$(BIN)/thermofast identify sample_runs/spindle.csv --until 60 -q -o out/spindle.json
	$(BIN)/thermofast diagnose sample_runs/hidden.csv -q --format table
	$(BIN)/thermofast improve sample_runs/hidden.csv --auto -q --format table -o out/machine.toml --save-plot out/staircase.png
	@echo
	@echo "Each sensor's steady state and settling time from the first 60 of 400 minutes stand above, and in out/spindle.json."
	@echo "In hidden.csv the base model misses something: diagnose names it, improve adds it; the model learnt is out/machine.toml."
	@echo "Pictures: out/spindle.png out/sweep.png out/staircase.png"

test: $(STAMP)  ## install, run the whole suite
	$(BIN)/python -m pytest

coverage: $(STAMP)  ## the suite again, with the share of lines that it runs (95 % at least; half as long again)
	$(BIN)/python -m pytest --cov --cov-report=term:skip-covered

check: $(STAMP)  ## linters and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/bandit -q -r thermofast_cli models filters -c pyproject.toml
	@rm -rf build/typing && mkdir -p build/typing/thermofast  # the three folders as the one package that they are installed as
	@ln -s $(CURDIR)/thermofast_cli/* $(CURDIR)/models $(CURDIR)/filters build/typing/thermofast/
	$(BIN)/mypy

audit: $(STAMP)  ## known faults of what is installed; needs the network
	$(BIN)/python -m pip install --quiet pip-audit
	$(BIN)/pip-audit --skip-editable

dist: $(STAMP)  ## sdist and wheel, each installed and tried in an environment of its own
	$(BIN)/python -m benchmarks.project.release

site: $(STAMP)  ## docs/ as pages, with the reference that the program writes; every warning is an error
	$(BIN)/python -m sphinx -q -W --keep-going -E -b html docs out/site

bench: $(STAMP)  ## most figures of docs/figures.md, beside their peers
	$(BIN)/python -m benchmarks

proof: $(STAMP)  ## the long tests; then how often the discovery loop is right, on simulated machines: writes docs/proof.md (an hour or two)
	$(BIN)/python -m pytest -m proof
	$(BIN)/python -m benchmarks.discovery.proof

docs: $(STAMP)  ## pictures and tables in docs/ that programs make
	$(BIN)/python -m benchmarks.documents.pictures
	$(BIN)/python -m benchmarks.documents.tutorial
	$(BIN)/python -m benchmarks.documents.real --all
	$(BIN)/python -m pip install --quiet nbclient ipykernel
	$(BIN)/python -m benchmarks.documents.notebook

help:  ## what can be made
	@grep -hE '^[a-z]+:.*##' Makefile | sed -E 's/^([a-z]+):[^#]*##/  \1:/'

clean:  ## take away what was made
	rm -rf .venv build dist out *.egg-info models/core/*.so models/imperfection/*.so filters/*.so models/core/*.c models/imperfection/*.c filters/*.c

$(STAMP): pyproject.toml setup.py $(wildcard models/*/*.pyx) filters/_loop.pyx
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable ".[dev]" $(if $(LOCKED),--constraint constraints.txt)
	@$(BIN)/python -c "from thermofast import models; print('compiled core' if models.COMPILED else 'no compiler found: the numpy core is used, which is slower')"
	@touch $(STAMP)
