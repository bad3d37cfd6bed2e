# The commands of this project: `make` lists them. The work is done by the scripts in .ci/ and docker/.

SHELL := /bin/bash
.DEFAULT_GOAL := help
BIN := .venv/bin
export OMP_NUM_THREADS ?= 1

.PHONY: help setup demo test test-unit test-near test-mpi test-debian test-image lint docs clean distclean

help: ## List these commands
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 20
	@echo
	@echo "  PYTHON=/path/to/python3   interpreter for .venv (3.12 or newer; found by itself if absent)"
	@echo "  DOLFINX=system|wheel      the distribution's DOLFINx or the one from PyPI (default: the first if it is there)"
	@echo "  FILES='impactfem/x.py'    files of test-near (default: those changed since main, and not committed)"
	@echo "  ARGS='-k bar'             further arguments for pytest"

setup: ## Make .venv with impactfem, DOLFINx and the tools (the other commands do it too)
	@PYTHON="$(PYTHON)" DOLFINX="$(DOLFINX)" .ci/setup

demo: setup ## Run the main demo, an elastic bar against a wall: results/bar_impact
	@$(BIN)/impactfem run demos/bar_impact/scene.toml --out results/bar_impact
	@echo "Pictures:"; ls results/bar_impact/*.png | sed 's/^/  /'

test: setup ## Run all tests: serial, then on 2 and on 4 MPI ranks
	@.ci/test all $(ARGS)

test-unit: setup ## Run the quick tests only (about two minutes on two cores)
	@.ci/test unit $(ARGS)

test-near: setup ## Run the tests that concern changed files, or FILES="impactfem/x/y.py ..."
	@$(BIN)/python .ci/test-near $(FILES) -- $(ARGS)

test-mpi: setup ## Run only the tests on 2 and on 4 MPI ranks
	@.ci/test mpi $(ARGS)

test-debian: ## Run the tests that versions matter to against Debian 13's own DOLFINx 0.9 (root user, mmdebstrap)
	@docker/test-debian.sh $(ARGS)

test-image: ## Build the container image and run the demo in it (root user, mmdebstrap, buildah)
	@docker/test-image.sh

lint: setup ## Check style, spelling, types and the order of the layers
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/codespell
	@$(BIN)/mypy
	@$(BIN)/mypy demos/user_project/src demos/user_project/tests
	@$(BIN)/lint-imports

docs: setup ## Run the demos, build the documentation, check its links: docs/_build/html/index.html
	@test -f docs/conf.py || { echo "docs/conf.py does not exist yet" >&2; exit 1; }
	@$(BIN)/python -m sphinx -W --keep-going -q -t gallery -b html docs docs/_build/html
	@$(BIN)/python docs/scripts/check_links.py docs/_build/html
	@echo "Documentation: docs/_build/html/index.html"

clean: ## Remove caches and build products (keeps results/ and .venv)
	@rm -rf build dist *.egg-info docs/_build docs/generated .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	@find impactfem tests demos docs benchmarks .ci -name __pycache__ -prune -exec rm -rf {} + 2>/dev/null || true

distclean: clean ## Remove .venv and the Debian root too
	@docker/test-debian.sh --remove
	@rm -rf .venv
