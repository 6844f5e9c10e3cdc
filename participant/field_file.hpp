// Writes fields as VTKHDF files (https://docs.vtk.org: VTKHDF file format), version 1.0, which ParaView,
// VTK 9.1 and later, and PyVista open, and their index for time series (`.hdf.series`).
//
// Limits of the readers in Debian 12 that shape what is written here: a flat image crashes them, so a
// two-dimensional field is written as two equal layers one spacing apart; cell data of images is not read, so
// all is point data.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace estuary {

/// A named field with one, two or three components per point, interleaved. Two components are written as
/// three with a zero, so that viewers treat them as vectors.
struct FieldView {
  std::string name;
  std::uint32_t components = 1;
  std::span<const double> values;
};

/// Values on a regular grid of nx x ny (x nz) points, x running fastest. nz = 1 for two dimensions.
void write_image(const std::filesystem::path& file, std::array<std::uint32_t, 3> points,
                 std::array<double, 3> origin, double spacing, std::span<const FieldView> fields);

/// Values on scattered points; `positions` has `dimension` components per point. `segments` (pairs of point
/// numbers, may be empty) become lines; points are drawn as vertices when there are none.
void write_points(const std::filesystem::path& file, std::uint32_t dimension,
                  std::span<const double> positions, std::span<const std::uint32_t> segments,
                  std::span<const FieldView> fields);

/// The index of a series of files: keeps `name`.hdf.series in `folder` up to date after each frame.
class FieldSeries {
public:
  FieldSeries(std::filesystem::path folder, std::string name);
  /// File name of frame `number`: "<name>-000012.hdf".
  [[nodiscard]] std::string file_name(std::uint64_t number) const;
  /// Adds a written frame and rewrites the index.
  void add(std::uint64_t number, double time);

private:
  std::filesystem::path folder_;
  std::string name_;
  std::vector<std::pair<std::string, double>> frames_;
};

}  // namespace estuary
