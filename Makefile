# make demo    sets up, then runs the paper's press: derive, generate, compile, simulate, figures
# make test    sets up, then runs the tests without the long ones: about five minutes on two cores
# make lint    style, types, layers of imports, freshness of the committed artefact
# make docs    builds the documentation into docs/_build/html
# make generated   derives the committed artefact anew
# make extremes   runs all extreme cases, also the long ones, and writes docs/extremes.md (some minutes)
# make trade   measures accuracy against time on the shipped scenes and writes docs/trade.md (about ten minutes)
# make bench   installs the peers into a venv of their own and measures (25 quiet minutes); QUICK=1: two minutes, for show

PYTHON ?= python3
VENV ?= .venv
export PYTHON VENV
# images of containers set it: each process of the tests would compile all of its modules anew
unexport PYTHONDONTWRITEBYTECODE
BIN := $(VENV)/bin

.PHONY: demo test lint docs generated trade bench clean extremes compiler
.DEFAULT_GOAL := demo

demo: $(VENV)/.ready
	$(BIN)/ballpass run scenes/punching_press.toml

test: $(VENV)/.ready-dev
	$(BIN)/python -m pytest -n 2 --dist loadfile

# ziglang beside gcc: cases that compare two compilers run then
compiler: $(VENV)/.ready-compiler

lint: $(VENV)/.ready-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo
	$(BIN)/python scripts/import_contract.py
	$(BIN)/python scripts/code_lines.py
	$(BIN)/ballpass derive --check scenes/punching_press.toml

docs: $(VENV)/.ready-docs
	@echo "Building the pages. The gallery computes its figures, which takes minutes; each page and figure is named."
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html
	@echo docs/_build/html/index.html

generated: $(VENV)/.ready
	$(BIN)/ballpass derive scenes/punching_press.toml

trade: $(VENV)/.ready
	$(BIN)/python -m benchmarks.trade

BENCH_VENV := benchmarks/.venv

bench: $(BENCH_VENV)/.ready
	$(BENCH_VENV)/bin/python -m benchmarks $(if $(QUICK),--quick)

extremes: $(VENV)/.ready-dev $(VENV)/.ready-compiler
	$(BIN)/python -m pytest -n 2 -m extreme tests/extremes --extremes-page docs/extremes.md
	$(BIN)/python -m pytest -n 2 -m extreme --ignore tests/extremes tests

$(BENCH_VENV)/.ready: pyproject.toml requirements.txt benchmarks/requirements.txt scripts/setup.sh
	@VENV=$(BENCH_VENV) scripts/setup.sh
	@$(BENCH_VENV)/bin/python -m pip install --quiet --disable-pip-version-check -c requirements.txt -c benchmarks/requirements.txt -e ".[bench]"
	@$(BENCH_VENV)/bin/python -m pip install --quiet --disable-pip-version-check -c benchmarks/requirements.txt numbalsoda || \
	  printf '%s\n' "bench: numbalsoda could not be installed (it has no wheel and needs gfortran and cmake; Debian: apt install gfortran); going on without" >&2
	@touch $@

clean:
	rm -rf results docs/_build docs/auto_gallery docs/gallery/generated build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis

$(VENV)/.ready: pyproject.toml requirements.txt scripts/setup.sh
	@scripts/setup.sh
	@touch $@

$(VENV)/.ready-dev: pyproject.toml requirements.txt scripts/setup.sh
	@scripts/setup.sh dev
	@touch $@ $(VENV)/.ready

# a second compiler, from PyPI: 100 MB of download, 400 MB on disk
$(VENV)/.ready-compiler: pyproject.toml requirements.txt scripts/setup.sh
	@scripts/setup.sh dev,compiler
	@touch $@ $(VENV)/.ready $(VENV)/.ready-dev

$(VENV)/.ready-docs: pyproject.toml requirements.txt scripts/setup.sh
	@scripts/setup.sh dev,docs
	@touch $@ $(VENV)/.ready $(VENV)/.ready-dev
