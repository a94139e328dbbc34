#!/bin/sh
# Brings uv: links the given path to the uv that is installed, or installs one beside it.
#
# usage: sh deploy/bootstrap.sh .bootstrap/uv
set -eu

target=$1
folder=$(dirname "$target")
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)

if uv --version >/dev/null 2>&1; then
    ln -sf "$(command -v uv)" "$target"
    exit 0
fi

for python in python3 python3.14 python3.13 python3.12 python3.11 none; do
    if [ "$python" = none ]; then
        echo "SwarmTouch needs Python 3.11 or newer; none of python3, python3.11 ... python3.14 is." >&2
        exit 1
    fi
    if "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
        break
    fi
done

echo "installing uv into $folder" >&2
if "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    "$python" -m venv "$folder/venv"
    "$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check uv
    ln -sf "$folder/venv/bin/uv" "$target"
elif "$python" -m pip --version >/dev/null 2>&1; then
    # Debian without python3-venv: pip alone is enough.
    "$python" -m pip install --quiet --disable-pip-version-check --target "$folder/lib" uv
    ln -sf "$folder/lib/bin/uv" "$target"
else
    echo "$python has neither venv nor pip. On Debian or Ubuntu: apt-get install python3-venv. Or install uv:" >&2
    echo "https://docs.astral.sh/uv/getting-started/installation/. Then run make again." >&2
    exit 1
fi
