# Every target does its own set-up: a virtual environment in .venv, made anew when pyproject.toml changes.
#   make demo    render a clip, find and fit the person in it, print the metrics and where the pictures are
#   make test    the quick tests           make test-all  all tests, the slow ones too (real kills, whole chains, notebooks)
#   make lint    style and types
#   make bench   measured speed            make docs    the documentation site, in out/pages
#   make figures tables of the pages, from results/    make notebooks  run those that are stale and store what they show
#   make clean   remove what the others made

PYTHON ?= python3
VENV ?= .venv
OUT ?= out
PY := $(VENV)/bin/python
# Files over two processes, each file in one of them: what a file renders or carves is made once.
PARALLEL := -n 2 --dist loadfile
READY := $(VENV)/.ready

# The arrays here are small: threads inside BLAS cost more than they bring, and hmc uses its cores in other ways.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help setup demo test test-all lint bench docs figures notebooks clean
help:
	@sed -n 's/^#   //p' Makefile

setup: $(READY)

$(READY): pyproject.toml
	@echo "setting up $(VENV) (once)"
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "hmc needs Python 3.11 or later; say which: make PYTHON=python3.12 ..." >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV) \
	  || { echo "python cannot make virtual environments; on Debian and Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@$(PY) -m pip install -qq --root-user-action=ignore -e ".[test]"
	@touch $(READY)

demo: $(READY)
	$(PY) -m hmc synth demo --out $(OUT)/demo
	$(PY) -m hmc pose $(OUT)/demo --out $(OUT)/demo-result --height auto
	$(PY) -m hmc evaluate $(OUT)/demo-result $(OUT)/demo
	$(PY) -m hmc view $(OUT)/demo-result $(OUT)/demo --out $(OUT)/demo.png
	$(PY) -m hmc view $(OUT)/demo-result $(OUT)/demo --out $(OUT)/demo.mp4
	@echo
	@echo "the fitted body over every camera: $(OUT)/demo.png (one frame), $(OUT)/demo.mp4 (all frames)"
	@echo "tables:                            $(OUT)/demo-result/"

test: $(READY)
	$(PY) -m pytest $(PARALLEL) -m "not slow"

test-all: $(READY)
	$(PY) -m pytest $(PARALLEL)

lint: $(READY)
	$(VENV)/bin/ruff check --output-format concise
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy

bench: $(READY)
	@for file in benchmarks/bench_*.py; do echo "== $$file"; $(PY) $$file || exit 1; done

figures: $(READY)
	$(PY) docs/make_tables.py

notebooks: $(READY)
	$(PY) docs/run_notebooks.py

docs: $(READY)
	@$(PY) -m pip install -qq --root-user-action=ignore -e ".[docs]"
	$(PY) docs/make_pages.py --out $(OUT)/pages

clean:
	rm -rf $(VENV) $(OUT)/demo* $(OUT)/pages build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
