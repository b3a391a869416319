#!/usr/bin/env python3
"""Cuts the MAVLink definitions down to the messages that gimbald decodes or sends.

    python3 dialect/trim.py MESSAGE_DEFINITIONS_DIR > dialect/gimbald.xml

Reads storm32.xml and everything it includes. Enumerations are left out and every field becomes a
plain number, so that a value newer than the definitions never costs a message; descriptions are left
out as well. The wire format (order, lengths, CRC_EXTRA) does not depend on either. A test compares
the result with the full dialect.
"""

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

KEEP = {
    0, 1, 2, 4, 11, 20, 21, 22, 23, 24, 27, 30, 31, 32, 33, 36, 40, 42, 43, 44, 45, 47, 51, 65, 66, 69, 73,
    74, 75, 76, 77, 80, 87, 109, 110, 111, 125, 147, 148, 156, 157, 158, 183, 193, 230, 242, 244, 245, 253, 256, 259,
    260, 265, 271, 280, 281, 282, 283, 284, 285, 286, 287, 288, 300, 345, 385, 396, 410, 436,
    60000, 60010, 60011, 60012, 60013, 60014, 60020,
}


def messages(path, seen):
    if path in seen:
        return
    seen.add(path)
    root = ET.parse(path).getroot()
    for include in root.findall("include"):
        yield from messages(path.parent / include.text.strip(), seen)
    yield from root.findall("messages/message")


def main():
    found = {}
    for message in messages(Path(sys.argv[1]) / "storm32.xml", set()):
        found.setdefault(int(message.get("id")), message)
    missing = KEEP - found.keys()
    if missing:
        sys.exit(f"not in the definitions: {sorted(missing)}")
    out = ['<?xml version="1.0"?>', "<mavlink>", "  <version>3</version>", "  <messages>"]
    for number in sorted(KEEP):
        message = found[number]
        name = message.get("name")
        out.append(f'    <message id="{number}" name="{name}">')
        out.append(f"      <description>{name}</description>")
        for child in message:
            if child.tag == "extensions":
                out.append("      <extensions/>")
            elif child.tag == "field":
                field, kind = child.get("name"), child.get("type")
                out.append(f'      <field type="{kind}" name="{field}">{field}</field>')
        out.append("    </message>")
    out += ["  </messages>", "</mavlink>"]
    print("\n".join(out))


if __name__ == "__main__":
    main()
