// Reads the frames participants leave (VTKHDF, as written by participant/field_file.hpp) for the pictures of
// a report.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace estuary::coupler {

struct FrameField {
  std::size_t components = 1;
  std::vector<double> values;  // components of one point next to each other
};

/// One plane of an image: `nx` x `ny` points, x fastest, `spacing` apart, the first one at (x0, y0).
struct ImageFrame {
  std::size_t nx = 0;
  std::size_t ny = 0;
  double x0 = 0;
  double y0 = 0;
  double spacing = 1;
  std::map<std::string, FrameField> fields;
};

struct PointFrame {
  std::vector<double> positions;      // x y of each point; a third coordinate is left out
  std::vector<std::size_t> segments;  // pairs of point numbers
  std::map<std::string, FrameField> fields;
};

struct NamedFrame {
  std::filesystem::path file;
  double time = 0;
};

/// The last frame named in `folder`/`series`.hdf.series that exists; nothing when there is none.
std::optional<NamedFrame> last_frame(const std::filesystem::path& folder, const std::string& series);
/// The first one.
std::optional<NamedFrame> first_frame(const std::filesystem::path& folder, const std::string& series);

/// Throw std::runtime_error naming the file and what is wrong with it: another type, sizes that do not fit
/// together, more than a hundred million values.
ImageFrame read_image_frame(const std::filesystem::path& file);
PointFrame read_point_frame(const std::filesystem::path& file);

}  // namespace estuary::coupler
