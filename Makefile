# Needs Python 3.11+ with its headers and make; everything else is set up in .venv by the targets themselves.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
ATLAS ?= atlas.h5
HOST ?= 127.0.0.1
PORT ?= 8000

# Of what is installed, and of what a build needs: the second name from pip 25.3 on.
export PIP_CONSTRAINT := constraints.txt
export PIP_BUILD_CONSTRAINT := constraints.txt

.PHONY: help run test fault audit parts lock wheel lint style types map report accept everyday engine poses function limits stability studies drives assembly bench docs site scenes clean setup
.DELETE_ON_ERROR:

help:
	@echo "make setup      make the environment .venv, compile the kernel; the others do it themselves"
	@echo "make run        build the atlas if there is none, answer the example, serve on $(HOST):$(PORT)"
	@echo "make lint       style of Python (ruff) and JavaScript (oxfmt, oxlint), English, types (mypy)"
	@echo "make test       the default tests (about five minutes), the slowest fifty listed"
	@echo "make map        the packages by floor and who imports whom; fails on an arrow up or a circle"
	@echo "make fault      what it withstands: kills, bit flips, hostile clients behind nginx"
	@echo "make audit      known weaknesses of the locked parts (asks a database over the network)"
	@echo "make parts      the list of parts as CycloneDX: parts.cdx.json"
	@echo "make lock       the parts of the container and of its build with their hashes: requirements.lock, build.lock"
	@echo "make wheel      a wheel for this version of Python on this kind of machine, to install without a compiler: dist/"
	@echo "make docs       draw the pictures and fill the tables of all documents from the stored results, without measuring"
	@echo "make site       build the documentation with its examples: site/index.html (a minute)"
	@echo "make scenes     measure the scenes: docs/lift.md, docs/chain.md, docs/knotter.md (a few minutes)"
	@echo "make report     error against run time (about half an hour)"
	@echo "make everyday   everyday questions to the running service (half an hour)"
	@echo "make engine     every kind of search beside the best known answers (three quarters of an hour)"
	@echo "make poses      poses without crank angles, noise and other programs (some minutes)"
	@echo "make limits     requests within limits, beside general optimisers (some minutes)"
	@echo "make function   named functions and other programs (some minutes)"
	@echo "make stability  extreme cases against high precision (a minute)"
	@echo "make assembly   layers of random machines against shapely (ten minutes)"
	@echo "make drives     drives against finer grids, circles and equilibrium (some minutes)"
	@echo "make studies    forces, tolerances of manufacture, stock lengths (a few minutes)"
	@echo "make accept     1,000 random cases of every class, errors recomputed independently (about half an hour)"
	@echo "make bench      build, load, scan, larger atlases, many requests"
	@echo "                (half an hour; needs 6 GB of disk, no other work on the machine)"
	@echo "make clean      remove the environment and the atlas"

setup: $(READY)

$(READY): pyproject.toml constraints.txt setup.py build_backend/__init__.py $(wildcard synthesis/kernels/*.p*) synthesis/atlas/tree_kernel.py
	@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("linkage-atlas needs Python 3.11 or newer, $(PYTHON) is " + sys.version.split()[0] + "; set PYTHON=")'
	@$(PYTHON) -c 'import os, sys, sysconfig; os.path.exists(sysconfig.get_path("include") + "/Python.h") or sys.exit("linkage-atlas needs Python.h to compile its kernel: on Debian and Ubuntu the package python3-dev")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,docs]'
	@touch $@

$(ATLAS): | $(READY)
	$(BIN)/linkage-atlas build --out $@

run: $(READY) $(ATLAS)
	@echo; echo "The bundled example (app/examples/worked_example.json), with atlas rows as they are and refined:"; echo
	@$(BIN)/linkage-atlas synthesize --atlas $(ATLAS) --example atlas_rows_only
	@echo
	@$(BIN)/linkage-atlas synthesize --atlas $(ATLAS) --example worked_example
	@echo; echo "Serving on http://$(HOST):$(PORT) (stop with Ctrl-C; the routes: http://$(HOST):$(PORT)/docs). Ask it, from another terminal:"
	@echo "  curl -s http://$(HOST):$(PORT)/v2/synthesize -H 'content-type: application/json' -d @app/examples/worked_example.json"
	@echo
	@$(BIN)/linkage-atlas serve --atlas $(ATLAS) --host $(HOST) --port $(PORT)

test: $(READY)  # compiled modules are kept, whatever the environment says: the tests start many processes
	OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 3 --no-loadscope-reorder --durations=50

fault: $(READY)
	.ci/nginx
	$(BIN)/python -m pytest -m fault

wheel: $(READY)
	rm -rf build
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .

lock: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(BIN)/uv pip compile --quiet pyproject.toml -c constraints.txt --generate-hashes --universal --python-version 3.11 \
	  --no-header --no-annotate -o requirements.lock
	grep -E '^(setuptools|cython|ziglang)=' constraints.txt | $(BIN)/uv pip compile --quiet - --generate-hashes --universal \
	  --python-version 3.11 --no-header --no-annotate -o build.lock

audit: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[audit]'
	$(BIN)/python -m pip check
	$(BIN)/pip-audit --require-hashes --disable-pip -r requirements.lock -r build.lock

parts: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[audit]'
	$(BIN)/cyclonedx-py requirements --pyproject pyproject.toml --output-reproducible -o parts.cdx.json requirements.lock

lint: style types

style: $(READY)
	$(BIN)/python -m ruff check .
	$(BIN)/python -m ruff format --check .
	$(BIN)/oxfmt --check app/static app/docs/docs.js
	$(BIN)/oxlint app/static app/docs/docs.js
	$(BIN)/python -m tests.prose --check

types: $(READY)
	$(BIN)/python -m mypy

map: $(READY)
	$(BIN)/python -m docs.map

bench: $(READY) $(ATLAS)
	$(BIN)/python -m benchmarks.throughput --atlas $(ATLAS)
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.retrieval

docs: $(READY)
	$(BIN)/python -m docs.figures
	$(BIN)/python -m docs.howto_pictures
	$(BIN)/python -m benchmarks.report

site: $(READY)
	MPLBACKEND=agg COLUMNS=100 $(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet docs site

scenes: $(READY)
	$(BIN)/python -m benchmarks.lift
	$(BIN)/python -m benchmarks.lift_constrained
	$(BIN)/python -m benchmarks.chain
	$(BIN)/python -m benchmarks.knotter

report: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,docs,baselines]'
	$(BIN)/python -m benchmarks.error_vs_runtime

accept: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.acceptance --cases 1000

everyday: $(READY)
	$(BIN)/python -m benchmarks.everyday

engine: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.engine

poses: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,docs,baselines]'
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.free_timing

limits: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.limited

function: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,docs,baselines]'
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.function

stability: $(READY)
	$(BIN)/python -m benchmarks.stability

assembly: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.assembly

drives: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.drives

studies: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.studies

clean:
	rm -rf $(VENV) build dist *.egg-info synthesis/kernels/*.c synthesis/kernels/*.so synthesis/atlas/tree_kernel.c \
	  synthesis/atlas/tree_kernel.*.so $(ATLAS)
