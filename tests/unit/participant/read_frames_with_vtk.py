#!/usr/bin/python3
"""Reads the frames of write_sample_frames with VTK's reader, the one inside ParaView, and checks what it sees.

Usage: read_frames_with_vtk.py PROGRAM
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import VTK_LINE, VTK_VERTEX
from vtkmodules.vtkIOHDF import vtkHDFReader

PROGRAM = sys.argv[1]


def read(path):
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def names(data):
    point_data = data.GetPointData()
    return sorted(point_data.GetArrayName(i) for i in range(point_data.GetNumberOfArrays()))


def values(data, name):
    return vtk_to_numpy(data.GetPointData().GetArray(name)).tolist()


class Frames(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        subprocess.run([PROGRAM, str(cls.folder)], check=True)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def test_plane_image_is_two_equal_layers(self):
        data = read(self.folder / "plane.hdf")
        self.assertEqual(data.GetDimensions(), (4, 3, 2))
        self.assertEqual(data.GetNumberOfPoints(), 24)
        self.assertEqual(data.GetPoint(0), (0.25, -1.0, 0.0))
        self.assertEqual(data.GetPoint(5), (0.75, -0.5, 0.0))
        self.assertEqual(data.GetPoint(12), (0.25, -1.0, 0.5))
        self.assertEqual(names(data), ["pressure", "velocity"])
        layer = [100.0 + i for i in range(12)]
        self.assertEqual(values(data, "pressure"), layer + layer)
        velocity = values(data, "velocity")
        self.assertEqual(velocity[:12], [[0.5 + 2 * i, 1.5 + 2 * i, 0.0] for i in range(12)])
        self.assertEqual(velocity[12:], velocity[:12])

    def test_block_image_has_x_fastest(self):
        data = read(self.folder / "block.hdf")
        self.assertEqual(data.GetDimensions(), (2, 3, 4))
        self.assertEqual(data.GetPoint(1), (1.25, 2.0, 3.0))
        self.assertEqual(data.GetPoint(2), (1.0, 2.25, 3.0))
        self.assertEqual(data.GetPoint(6), (1.0, 2.0, 3.25))
        self.assertEqual(values(data, "density"), [1000.0 + i for i in range(24)])
        self.assertEqual(values(data, "vorticity"), [[-7.0 + 3 * i + c for c in range(3)] for i in range(24)])

    def check_points(self, data):
        self.assertEqual(data.GetNumberOfPoints(), 3)
        self.assertEqual([data.GetPoint(i) for i in range(3)], [(0, 0, 0), (1, 0.5, 0), (2, -0.5, 0)])
        self.assertEqual(names(data), ["displacement", "stress"])
        self.assertEqual(values(data, "stress"), [10.0, 11.0, 12.0])
        self.assertEqual(values(data, "displacement"), [[0.1 + 2 * i, 0.1 + (2 * i + 1), 0.0] for i in range(3)])

    def test_points_are_vertices(self):
        data = read(self.folder / "points.hdf")
        self.check_points(data)
        self.assertEqual(data.GetNumberOfCells(), 3)
        self.assertEqual([data.GetCellType(i) for i in range(3)], [VTK_VERTEX] * 3)
        self.assertEqual([data.GetCell(i).GetPointId(0) for i in range(3)], [0, 1, 2])

    def test_polyline_is_lines(self):
        data = read(self.folder / "polyline.hdf")
        self.check_points(data)
        self.assertEqual(data.GetNumberOfCells(), 2)
        self.assertEqual([data.GetCellType(i) for i in range(2)], [VTK_LINE] * 2)
        ends = [[data.GetCell(i).GetPointId(j) for j in range(2)] for i in range(2)]
        self.assertEqual(ends, [[0, 1], [1, 2]])

    def test_points_in_space_keep_their_third_coordinate(self):
        data = read(self.folder / "points-3d.hdf")
        self.assertEqual([data.GetPoint(i) for i in range(4)], [(1 + 3 * i, 2 + 3 * i, 3 + 3 * i) for i in range(4)])

    def test_no_points_is_a_file_too(self):
        data = read(self.folder / "no-points.hdf")
        self.assertEqual((data.GetNumberOfPoints(), data.GetNumberOfCells()), (0, 0))

    def test_series_names_files_that_exist_with_their_times(self):
        index = json.loads((self.folder / "frame.hdf.series").read_text())
        self.assertEqual(index["file-series-version"], "1.0")
        self.assertEqual(index["files"], [{"name": "frame-000000.hdf", "time": 0.0}, {"name": "frame-000012.hdf", "time": 0.6}])
        for entry in index["files"]:
            self.assertEqual(read(self.folder / entry["name"]).GetNumberOfPoints(), 24)

    def test_nothing_temporary_is_left(self):
        self.assertEqual(list(self.folder.glob("*.part")), [])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
