# First stage: the environment and the atlas. Second stage: both, and nothing that builds.
FROM python:3.12-slim@sha256:78387bc3881b8273120a12ebe6c1ab22b018ccc2c9adf565ae1ac9b536e184ea AS build
WORKDIR /src
COPY pyproject.toml setup.py requirements.lock build.lock README.md LICENSE ./
COPY build_backend build_backend
COPY synthesis synthesis
COPY data_build data_build
COPY linkage_atlas linkage_atlas
COPY app app
RUN python -m venv /opt/linkage-atlas \
 && /opt/linkage-atlas/bin/pip install --no-cache-dir --disable-pip-version-check --require-hashes -r requirements.lock \
 && pip install --no-cache-dir --disable-pip-version-check --require-hashes -r build.lock \
 && pip wheel --no-cache-dir --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir /wheel . \
 && /opt/linkage-atlas/bin/pip install --no-cache-dir --disable-pip-version-check --no-deps /wheel/*.whl
RUN /opt/linkage-atlas/bin/linkage-atlas build --out /opt/linkage-atlas/atlas.h5 \
 && /opt/linkage-atlas/bin/linkage-atlas verify /opt/linkage-atlas/atlas.h5

FROM python:3.12-slim@sha256:78387bc3881b8273120a12ebe6c1ab22b018ccc2c9adf565ae1ac9b536e184ea
RUN useradd --system --no-create-home --shell /usr/sbin/nologin atlas
COPY --from=build /opt/linkage-atlas /opt/linkage-atlas
ENV PATH=/opt/linkage-atlas/bin:$PATH \
    LINKAGE_ATLAS_ATLAS=/opt/linkage-atlas/atlas.h5 \
    MALLOC_ARENA_MAX=2 \
    OMP_NUM_THREADS=1 \
    PYTHONUNBUFFERED=1
USER atlas
WORKDIR /tmp
EXPOSE 8000
HEALTHCHECK --interval=15s --timeout=5s --start-period=60s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/readyz', timeout=4)"]
CMD ["linkage-atlas", "serve", "--host", "0.0.0.0", "--port", "8000"]
