#!/usr/bin/env bash
# Builds what benches/speed.py needs, and runs it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../../.."
cargo build --locked --release -p calib-offline
environment=$(scripts/python-env.sh --speed)
exec "$environment/bin/python" ray-runtime/python/benches/speed.py
