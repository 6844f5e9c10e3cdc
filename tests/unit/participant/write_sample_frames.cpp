// Writes one frame of each kind into the folder given, with values that read_frames_with_vtk.py knows.
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <vector>

#include "field_file.hpp"

namespace {

using estuary::FieldView;

/// f(i) = start + i for the i-th value.
std::vector<double> counting(std::size_t length, double start) {
  std::vector<double> values(length);
  for (std::size_t i = 0; i < length; ++i) values[i] = start + static_cast<double>(i);
  return values;
}

void write_all(const std::filesystem::path& folder) {
  const auto pressure = counting(4 * 3, 100.0);
  const auto velocity = counting(4 * 3 * 2, 0.5);
  const std::vector<FieldView> plane{{"pressure", 1, pressure}, {"velocity", 2, velocity}};
  estuary::write_image(folder / "plane.hdf", {4, 3, 1}, {0.25, -1.0, 0.0}, 0.5, plane);

  const auto density = counting(2 * 3 * 4, 1000.0);
  const auto vorticity = counting(2 * 3 * 4 * 3, -7.0);
  const std::vector<FieldView> block{{"density", 1, density}, {"vorticity", 3, vorticity}};
  estuary::write_image(folder / "block.hdf", {2, 3, 4}, {1.0, 2.0, 3.0}, 0.25, block);

  const std::vector<double> positions{0.0, 0.0, 1.0, 0.5, 2.0, -0.5};
  const auto stress = counting(3, 10.0);
  const auto displacement = counting(6, 0.1);
  const std::vector<FieldView> on_points{{"stress", 1, stress}, {"displacement", 2, displacement}};
  estuary::write_points(folder / "points.hdf", 2, positions, {}, on_points);
  const std::vector<std::uint32_t> segments{0, 1, 1, 2};
  estuary::write_points(folder / "polyline.hdf", 2, positions, segments, on_points);

  const auto positions_3d = counting(4 * 3, 1.0);
  estuary::write_points(folder / "points-3d.hdf", 3, positions_3d, {}, {});
  estuary::write_points(folder / "no-points.hdf", 2, {}, {}, {});

  estuary::FieldSeries series(folder, "frame");
  estuary::write_image(folder / series.file_name(0), {4, 3, 1}, {0.0, 0.0, 0.0}, 1.0, plane);
  series.add(0, 0.0);
  estuary::write_image(folder / series.file_name(12), {4, 3, 1}, {0.0, 0.0, 0.0}, 1.0, plane);
  series.add(12, 0.6);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    write_all(argv[1]);
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
