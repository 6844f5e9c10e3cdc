#!/usr/bin/env python3
"""Makes trabecular-bone.png: a synthetic section of trabecular bone, free of any scan.

Cosine waves of one wave length, random directions and random phases are summed; where the sum is large the picture is
dark (bone), elsewhere bright (marrow). The threshold is chosen for the wanted share of bone. Usage:
    trabecular-bone.py FILE [--width 123] [--height 100] [--wave 26] [--bone 0.35] [--seed 3] [--scale 1]
`--scale 2` draws the same bone with twice the pixels.
"""
import argparse
import math
import random
import struct
import zlib


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("file")
    parser.add_argument("--width", type=int, default=123)
    parser.add_argument("--height", type=int, default=100)
    parser.add_argument("--wave", type=float, default=26.0, help="wave length in pixels at scale 1")
    parser.add_argument("--bone", type=float, default=0.35, help="share of bone")
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--scale", type=int, default=1)
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

    rows = b"".join(b"\0" + bytes(0 if value > threshold else 255 for value in field[r * width:(r + 1) * width])
                    for r in range(height))

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    with open(options.file, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


if __name__ == "__main__":
    main()
