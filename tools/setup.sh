#!/usr/bin/env bash
# Build .venv from requirements.lock and put this checkout into it. Instant and without network when nothing changed.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf 'setup: %s\n' "$*" >&2; }
fail() { say "$*"; exit 2; }

# Shared libraries that the wheels expect from the system, each with its Debian package.
libraries="libGL.so.1:libgl1 libGLX.so.0:libgl1 libOpenGL.so.0:libopengl0 libEGL.so.1:libegl1 libX11.so.6:libx11-6
    libusb-1.0.so.0:libusb-1.0-0 libgomp.so.1:libgomp1 libidn2.so.0:libidn2-0 libcom_err.so.2:libcom-err2
    libp11-kit.so.0:libp11-kit0 libgpg-error.so.0:libgpg-error0 libfontconfig.so.1:libfontconfig1 libfreetype.so.6:libfreetype6"

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"
    elif command -v sudo >/dev/null; then sudo "$@"
    else fail "must be root to install system packages. Run as root: apt-get install -y ${packages[*]}"
    fi
}

find_python() {
    local name
    for name in ${PYTHON:-} python3 python3.13 python3.12 python3.11 python; do
        if "$name" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null; then
            "$name" -c 'import sys; print(sys.executable)'
            return
        fi
    done
    fail "needs Python 3.11, 3.12 or 3.13, found $(python3 --version 2>/dev/null || echo none). Install one (Debian, Ubuntu: apt-get install python3 python3-venv) or name it: make setup PYTHON=/path/to/python3.12"
}

# The packages that are missing, one a line.
missing_packages() {
    "$python" - $libraries <<'END'
import ctypes, sys
for pair in sys.argv[1:]:
    library, package = pair.split(":")
    try:
        ctypes.CDLL(library)
    except OSError:
        print(package)
END
    # Debian takes ensurepip out of its Python and puts it into a package of its own.
    "$python" -c 'import ensurepip, venv' 2>/dev/null || "$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])'
}

install_packages() {
    if ! command -v apt-get >/dev/null; then
        say "these system libraries are missing; their Debian names are: ${packages[*]}. Install them with your system's package manager."
        return
    fi
    say "installing system packages that are missing: ${packages[*]} (apt-get)"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${packages[@]}" >/dev/null 2>&1 && return
    as_root apt-get update >/dev/null || fail "apt-get update failed. Is there a network?"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${packages[@]}" >/dev/null ||
        fail "apt-get could not install ${packages[*]}."
}

# An environment that works here is kept, whatever Python the PATH now finds first, unless another is asked for by name.
if [ -n "${PYTHON:-}" ] || [ "$(cat .venv/place 2>/dev/null)" != "$(pwd)" ] || ! .venv/bin/python -c 'import pip' 2>/dev/null; then
    python=$(find_python)
else
    python=$(pwd)/.venv/bin/python
fi
if [ "$(uname)" = Linux ]; then
    mapfile -t packages < <(missing_packages | sort -u)
    if [ "${#packages[@]}" -gt 0 ]; then install_packages; fi
fi

# What the environment is made of: if any of it changes, the environment is brought up to date.
stamp=$(
    { pwd; "$python" -V; cat requirements.lock; sed -n '/^\[build-system\]/,/^\[tool\.ruff\]/p' pyproject.toml; } |
        "$python" -c 'import hashlib, sys; print(hashlib.sha256(sys.stdin.buffer.read()).hexdigest())'
)
if [ "$(cat .venv/stamp 2>/dev/null)" = "$stamp" ]; then exit 0; fi

if [ "$python" != "$(pwd)/.venv/bin/python" ]; then
    say "making .venv with $("$python" -V) ($python)"
    rm -rf .venv
    "$python" -m venv .venv
    pwd >.venv/place
fi
rm -f .venv/stamp
say "installing the locked requirements into .venv (about 2.5 GB at the first time; a few minutes)"
# Uncompiled: Python compiles what it imports, a fraction of what is installed.
.venv/bin/python -m pip install --quiet --quiet --disable-pip-version-check --no-compile --require-hashes -r requirements.lock ||
    fail "pip could not install the locked requirements. Is there a network, and is there space on the disk?"
say "putting this checkout into .venv"
.venv/bin/python -m pip install --quiet --quiet --disable-pip-version-check --no-deps --no-build-isolation --no-index --editable .
echo "$stamp" >.venv/stamp
say "done"
