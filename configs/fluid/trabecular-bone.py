#!/usr/bin/env python3
"""Makes trabecular-bone.png: a synthetic section of trabecular bone, free of any scan.

Cosine waves of one wave length, random directions and random phases are summed; where the sum is large the picture is
dark (bone), elsewhere bright (marrow). The threshold is chosen for the wanted share of bone. Usage:
    trabecular-bone.py FILE [--width 123] [--height 100] [--wave 26] [--bone 0.35] [--seed 3] [--scale 1] [--held]
`--scale 2` draws the same bone with twice the pixels. `--held` leaves out bone that does not reach the left, right or
lower edge, and fills marrow that does not reach from the upper edge to the lower: then every piece can be held, and marrow
can flow everywhere from above.
"""
import argparse
import math
import random
import struct
import zlib


def regions(rows, of):
    """Lists of the pixels (row, column) that are `of` and hang together by their sides."""
    height, width = len(rows), len(rows[0])
    seen = [[False] * width for _ in range(height)]
    for row in range(height):
        for column in range(width):
            if rows[row][column] != of or seen[row][column]:
                continue
            region, seen[row][column] = [(row, column)], True
            for r, c in region:  # grows while it is walked
                for nr, nc in ((r + 1, c), (r - 1, c), (r, c + 1), (r, c - 1)):
                    if 0 <= nr < height and 0 <= nc < width and rows[nr][nc] == of and not seen[nr][nc]:
                        seen[nr][nc] = True
                        region.append((nr, nc))
            yield region


def keep_held(rows):
    height, width = len(rows), len(rows[0])
    for region in regions(rows, True):
        if not any(c in (0, width - 1) or r == height - 1 for r, c in region):
            for r, c in region:
                rows[r][c] = False
    for region in regions(rows, False):
        if not (any(r == 0 for r, c in region) and any(r == height - 1 for r, c in region)):
            for r, c in region:
                rows[r][c] = True


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("file")
    parser.add_argument("--width", type=int, default=123)
    parser.add_argument("--height", type=int, default=100)
    parser.add_argument("--wave", type=float, default=26.0, help="wave length in pixels at scale 1")
    parser.add_argument("--bone", type=float, default=0.35, help="share of bone")
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--scale", type=int, default=1)
    parser.add_argument("--held", action="store_true")
    options = parser.parse_args()

    source = random.Random(options.seed)
    waves = []
    for _ in range(24):
        angle = source.uniform(0, math.pi)
        length = options.wave * source.uniform(0.8, 1.25)
        waves.append((2 * math.pi / length * math.cos(angle), 2 * math.pi / length * math.sin(angle),
                      source.uniform(0, 2 * math.pi)))

    width, height = options.width * options.scale, options.height * options.scale
    field = []
    for row in range(height):
        y = (row + 0.5) / options.scale
        for column in range(width):
            x = (column + 0.5) / options.scale
            field.append(sum(math.cos(kx * x + ky * y + phase) for kx, ky, phase in waves))
    threshold = sorted(field)[int((1 - options.bone) * (len(field) - 1))]

    bone = [[value > threshold for value in field[r * width:(r + 1) * width]] for r in range(height)]
    if options.held:
        keep_held(bone)
    rows = b"".join(b"\0" + bytes(0 if solid else 255 for solid in row) for row in bone)

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    with open(options.file, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


if __name__ == "__main__":
    main()
