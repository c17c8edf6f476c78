# `make` alone prints the list below. Everything runs in .venv, which `make setup` builds from requirements.lock.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup lint style types format test suite demo bench proof experiments notebooks lock clean
export PYTHON

BIN := .venv/bin
PACKAGES := materials scene transport evaluate
CODE := $(PACKAGES) benchmarks notebooks tests tools
# Real drives with measured disparity, for the experiments, where they are.
DRIVES := $(wildcard $(or $(MENISCUS_DATA),../shared/data)/kitti2015_drive/*.recording.json)

help:  ## print this list
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | while IFS=$$'\t' read -r name text; do printf '  make %-9s %s\n' "$$name" "$$text"; done

setup:  ## build .venv: system libraries, locked requirements, this checkout
	@tools/setup.sh

lint: style types  ## ruff, import-linter, basedpyright

style: setup
	$(BIN)/ruff check $(CODE)
	$(BIN)/ruff format --check $(CODE)
	$(BIN)/lint-imports

types: setup
	$(BIN)/basedpyright

format: setup  ## let ruff rewrite the code
	$(BIN)/ruff check --fix $(CODE)
	$(BIN)/ruff format $(CODE)

test: style  ## lint, and the whole test suite with its doctests; types, which take minutes on one core, are checked beside it
	@$(MAKE) --no-print-directory -j2 types suite

# Each worker gets a row of tests, so that files and the kernels they compile mostly stay with one; who is done takes from the others.
suite: setup
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal $(ARGS)

demo: setup  ## build the built-in street, wet it three times, leave a contact sheet in out/
	$(BIN)/python -m transport.demo $(ARGS)

bench: setup  ## measure speed against other renderers (they are installed first) -> out/bench.jsonl
	$(BIN)/python -m benchmarks $(ARGS)

proof: setup  ## show what is claimed, number by number -> out/proof.jsonl
	$(BIN)/python -m benchmarks.proof $(ARGS)

experiments: setup  ## run the experiments on optical flow -> out/experiments/NAME/report.html (hours; ARGS for all of them)
	$(BIN)/meniscus experiment fitted-materials -o out/experiments/fitted-materials $(ARGS)
	$(BIN)/meniscus experiment reflectance-fields -o out/experiments/reflectance-fields $(ARGS)
	$(BIN)/meniscus experiment true-wet -o out/experiments/true-wet $(ARGS)
	$(BIN)/meniscus experiment wetter -o out/experiments/wetter $(if $(DRIVES),--recordings $(DRIVES)) $(ARGS)

notebooks: setup  ## run the notebooks in notebooks/ (Jupyter is installed into .venv first)
	$(BIN)/python -m pip install --quiet --quiet --disable-pip-version-check --require-hashes -r requirements-notebooks.lock
	$(BIN)/python -m pytest --nbmake --nbmake-timeout=1200 notebooks/*.ipynb $(ARGS)

lock: setup  ## renew the lock files from pyproject.toml; ARGS=--upgrade takes the newest (needs network)
	tools/lock.sh $(ARGS)

clean:  ## remove the environment, caches and results
	rm -rf .venv out .ruff_cache .pytest_cache .import_linter_cache .hypothesis
	find $(CODE) -name __pycache__ -type d -prune -exec rm -rf {} +
