#!/usr/bin/env bash
# Intel HEX above 2 GB before nrf-intel-hex 1.4.0 (npm; nRF Connect's tools read HEX files with it).
#
# An extended linear address record (type 04) gives the upper 16 bits of an unsigned 32-bit address; flash on a QSPI bus often
# lies from 0x90000000. Expected: a file for such an address is read, or refused as beyond what is supported.
# Instead: from 0x80000000 on the address is taken for a negative number ("Address passed to MemoryMap is negative"), also in a
# file that the same library has written for that address a moment before. intelhex 2.3.0 and bincopy 20.1.1 read it.
# So: for memory-mapped flash above 0x7fffffff the documents send to `--format bin` and an address beside it.
#
# Output seen:
#   0x08000000: written :020000040800F2, read at 0x8000000
#   0x7ffffff0: written :020000047FFF7C, read at 0x7ffffff0
#   0x80000000: written :0200000480007A, Address passed to MemoryMap is negative
#   0x90000000: written :0200000490006A, Address passed to MemoryMap is negative
#   intelhex reads it at 0x90000000, bincopy at 0x90000000
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
npm install --silent --no-audit --no-fund --prefix "$folder" nrf-intel-hex@1.4.0 >/dev/null
python3 -m venv "$folder/python"
"$folder/python/bin/pip" install --quiet intelhex==2.3.0 bincopy==20.1.1
cat >"$folder/finding.js" <<'JAVASCRIPT'
const MemoryMap = require('nrf-intel-hex');

for (const address of [0x08000000, 0x7ffffff0, 0x80000000, 0x90000000]) {
  const text = new MemoryMap([[address, new Uint8Array([1, 2, 3, 4])]]).asHexString();
  let outcome;
  try {
    outcome = [...MemoryMap.fromHex(text).keys()].map((start) => `read at 0x${start.toString(16)}`).join();
  } catch (error) {
    outcome = error.message;
  }
  console.log(`0x${address.toString(16).padStart(8, '0')}: written ${text.split('\n')[0].trim()}, ${outcome}`);
}
JAVASCRIPT
cat >"$folder/finding.py" <<'PYTHON'
import io

import bincopy
import intelhex

TEXT = ":0200000490006A\n:0400000001020304F2\n:00000001FF\n"
binary = bincopy.BinFile()
binary.add_ihex(TEXT)
first = intelhex.IntelHex(io.StringIO(TEXT)).minaddr()
print(f"intelhex reads it at 0x{first:x}, bincopy at 0x{binary.minimum_address:x}")
PYTHON
{
  node "$folder/finding.js"
  "$folder/python/bin/python" "$folder/finding.py"
} | tee "$folder/seen"
sed -n 's/^#   //p' "${BASH_SOURCE[0]}" | diff - "$folder/seen" || {
  echo "changed: look at this finding again" >&2
  exit 1
}
