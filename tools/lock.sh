#!/usr/bin/env bash
# Renew the lock files, keeping the versions they name where these still serve; with --upgrade, take the newest: one resolution for Python 3.11 to 3.13 on every platform, with the hash of every file.
set -euo pipefail
cd "$(dirname "$0")/.."
uv=(uv)
if ! command -v uv >/dev/null; then
    .venv/bin/python -m pip install --quiet --target .venv/lock-tools uv
    uv=(.venv/lock-tools/bin/uv)
fi
upgrade=("$@")
# Only the public index is asked, whatever the machine is set up for, and no address is written into the file.
compile() {
    "${uv[@]}" pip compile --quiet --no-config --universal --python-version 3.11 --generate-hashes --no-annotate "${upgrade[@]}" \
        --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" "$@"
}
compile pyproject.toml --extra dev -o requirements.lock
compile pyproject.toml --extra notebooks --constraint requirements.lock -o requirements-notebooks.lock
compile pyproject.toml --extra denoise --constraint requirements.lock -o requirements-denoise.lock
compile pyproject.toml --extra peers --constraint requirements.lock -o requirements-peers.lock
compile - -o requirements-blender.lock <<<"bpy==4.5.15; python_version == '3.11'"
