#include "field_file.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "atomic_file.hpp"
#include "hdf5_handle.hpp"

namespace estuary {

namespace {

using hdf5::check;
using hdf5::Handle;

constexpr unsigned deflate_level = 1;    // more costs time and hardly shrinks floating-point fields
constexpr std::uint8_t vertex_cell = 1;  // VTK_VERTEX
constexpr std::uint8_t line_cell = 3;    // VTK_LINE

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& what) {
  throw std::invalid_argument(fmt::format("{}: {}", file.string(), what));
}

void check_fields(const std::filesystem::path& file, std::span<const FieldView> fields, std::size_t points) {
  std::set<std::string_view> names;
  for (const auto& field : fields) {
    if (field.name.empty() || field.name.find('/') != std::string::npos) {
      refuse(file, fmt::format("a field cannot be called '{}'", field.name));
    }
    if (!names.insert(field.name).second) refuse(file, fmt::format("two fields are called '{}'", field.name));
    if (field.components < 1 || field.components > 3) {
      refuse(file, fmt::format("field '{}' has {} components; 1 to 3 can be written", field.name,
                               field.components));
    }
    if (field.values.size() != points * field.components) {
      refuse(file, fmt::format("field '{}' has {} values; {} points with {} components need {}", field.name,
                               field.values.size(), points, field.components, points * field.components));
    }
  }
}

std::uint32_t components_written(std::uint32_t components) {
  return components == 2 ? 3 : components;
}

/// Copies points [first, first + count) of a field, two components becoming three.
void widen(std::span<const double> values, std::uint32_t components, std::size_t first, std::size_t count,
           std::vector<double>& out) {
  const std::size_t width = components_written(components);
  out.assign(count * width, 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < components; ++c) out[i * width + c] = values[(first + i) * components + c];
  }
}

void write_attribute(hid_t location, const std::filesystem::path& file, const char* name, hid_t file_type,
                     hid_t memory_type, hsize_t length, const void* values) {
  const auto what = fmt::format("attribute '{}' cannot be written", name);
  const Handle space(check(H5Screate_simple(1, &length, nullptr), file, what), H5Sclose);
  const Handle attribute(
      check(H5Acreate2(location, name, file_type, space.get(), H5P_DEFAULT, H5P_DEFAULT), file, what),
      H5Aclose);
  check(H5Awrite(attribute.get(), memory_type, values), file, what);
}

/// VTK 9.2 accepts only a fixed-length ASCII string here.
void write_type(hid_t location, const std::filesystem::path& file, std::string_view type) {
  const std::string what = "attribute 'Type' cannot be written";
  const Handle string_type(check(H5Tcopy(H5T_C_S1), file, what), H5Tclose);
  check(H5Tset_size(string_type.get(), type.size()), file, what);
  check(H5Tset_strpad(string_type.get(), H5T_STR_NULLPAD), file, what);
  const Handle space(check(H5Screate(H5S_SCALAR), file, what), H5Sclose);
  const Handle attribute(
      check(H5Acreate2(location, "Type", string_type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT), file,
            what),
      H5Aclose);
  check(H5Awrite(attribute.get(), string_type.get(), type.data()), file, what);
}

Handle create_group(hid_t location, const std::filesystem::path& file, const char* name) {
  return {check(H5Gcreate2(location, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), file,
                fmt::format("group '{}' cannot be created", name)),
          H5Gclose};
}

/// `extent` is the shape of the array and `chunk` the piece of it that is compressed (and written) at once.
Handle create_array(hid_t location, const std::filesystem::path& file, const std::string& name, hid_t type,
                    const std::vector<hsize_t>& extent, const std::vector<hsize_t>& chunk) {
  const auto what = fmt::format("array '{}' cannot be created", name);
  const int rank = static_cast<int>(extent.size());
  const Handle space(check(H5Screate_simple(rank, extent.data(), nullptr), file, what), H5Sclose);
  const Handle properties(check(H5Pcreate(H5P_DATASET_CREATE), file, what), H5Pclose);
  // The same values make the same file, whenever they are written.
  check(H5Pset_obj_track_times(properties.get(), false), file, what);
  if (std::find(extent.begin(), extent.end(), hsize_t{0}) == extent.end()) {
    check(H5Pset_chunk(properties.get(), rank, chunk.data()), file, what);
    check(H5Pset_shuffle(properties.get()), file, what);
    check(H5Pset_deflate(properties.get(), deflate_level), file, what);
  }
  return {
      check(H5Dcreate2(location, name.c_str(), type, space.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT),
            file, what),
      H5Dclose};
}

/// A whole array at once; `extent` has one or two entries.
void write_array(hid_t location, const std::filesystem::path& file, const std::string& name, hid_t file_type,
                 hid_t memory_type, const std::vector<hsize_t>& extent, const void* values) {
  constexpr hsize_t longest_chunk = hsize_t{1} << 17;
  auto chunk = extent;
  chunk[0] = std::min(chunk[0], longest_chunk);
  auto dataset = create_array(location, file, name, file_type, extent, chunk);
  if (extent[0] > 0) {
    check(H5Dwrite(dataset.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), file,
          fmt::format("array '{}' cannot be written", name));
  }
  dataset.close(file);
}

/// A VTKHDF file with its type; it is on the disk after `finish`.
class FieldFile {
public:
  FieldFile(const std::filesystem::path& file, std::string_view type)
      : file_(file), handle_(create(file)), group_(create_group(handle_.get(), file, "VTKHDF")) {
    const std::array<std::int64_t, 2> version{1, 0};
    write_attribute(group_.get(), file, "Version", H5T_STD_I64LE, H5T_NATIVE_INT64, 2, version.data());
    write_type(group_.get(), file, type);
  }

  [[nodiscard]] hid_t group() const { return group_.get(); }

  void finish() {
    group_.close(file_);
    write_atomically(file_, hdf5::content_of(handle_.get(), file_));
    handle_.close(file_);
  }

private:
  static Handle create(const std::filesystem::path& file) {
    hdf5::throw_instead_of_print();
    return hdf5::create_in_memory(file);
  }

  std::filesystem::path file_;
  Handle handle_;
  Handle group_;
};

/// One field of an image, layer by layer; a single layer is repeated to fill `layers`.
void write_layers(hid_t location, const std::filesystem::path& file, const FieldView& field,
                  std::array<std::uint32_t, 3> points, std::uint32_t layers) {
  const std::uint32_t width = components_written(field.components);
  std::vector<hsize_t> extent{layers, points[1], points[0]};
  if (width > 1) extent.push_back(width);
  auto chunk = extent;
  chunk[0] = 1;
  auto dataset = create_array(location, file, field.name, H5T_IEEE_F64LE, extent, chunk);
  const auto what = fmt::format("field '{}' cannot be written", field.name);
  const int rank = static_cast<int>(extent.size());
  const Handle memory_space(check(H5Screate_simple(rank, chunk.data(), nullptr), file, what), H5Sclose);
  const Handle file_space(check(H5Dget_space(dataset.get()), file, what), H5Sclose);
  const std::size_t per_layer = std::size_t{points[0]} * points[1];
  std::vector<double> layer;
  for (std::uint32_t k = 0; k < layers; ++k) {
    if (k < points[2]) widen(field.values, field.components, k * per_layer, per_layer, layer);
    std::vector<hsize_t> start(extent.size(), 0);
    start[0] = k;
    check(H5Sselect_hyperslab(file_space.get(), H5S_SELECT_SET, start.data(), nullptr, chunk.data(), nullptr),
          file, what);
    check(H5Dwrite(dataset.get(), H5T_NATIVE_DOUBLE, memory_space.get(), file_space.get(), H5P_DEFAULT,
                   layer.data()),
          file, what);
  }
  dataset.close(file);
}

}  // namespace

void write_image(const std::filesystem::path& file, std::array<std::uint32_t, 3> points,
                 std::array<double, 3> origin, double spacing, std::span<const FieldView> fields) {
  if (points[0] < 2 || points[1] < 2 || points[2] < 1) {
    refuse(file, fmt::format("an image needs at least 2 x 2 x 1 points; it has {} x {} x {}", points[0],
                             points[1], points[2]));
  }
  if (*std::max_element(points.begin(), points.end()) > std::uint32_t{1} << 30) {
    refuse(file, "an image of more than 2^30 points along one axis cannot be written");
  }
  if (!std::isfinite(spacing) || spacing <= 0)
    refuse(file, fmt::format("a spacing of {} cannot be drawn", spacing));
  check_fields(file, fields, std::size_t{points[0]} * points[1] * points[2]);

  const std::uint32_t layers = std::max(points[2], 2U);
  FieldFile out(file, "ImageData");
  const auto last = [](std::uint32_t count) { return static_cast<int>(count) - 1; };
  const std::array<int, 6> whole_extent{0, last(points[0]), 0, last(points[1]), 0, last(layers)};
  const std::array<double, 3> spacings{spacing, spacing, spacing};
  const std::array<double, 9> direction{1, 0, 0, 0, 1, 0, 0, 0, 1};
  write_attribute(out.group(), file, "WholeExtent", H5T_STD_I32LE, H5T_NATIVE_INT, 6, whole_extent.data());
  write_attribute(out.group(), file, "Origin", H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, 3, origin.data());
  write_attribute(out.group(), file, "Spacing", H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, 3, spacings.data());
  write_attribute(out.group(), file, "Direction", H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, 9, direction.data());
  auto point_data = create_group(out.group(), file, "PointData");
  for (const auto& field : fields) write_layers(point_data.get(), file, field, points, layers);
  point_data.close(file);
  out.finish();
}

void write_points(const std::filesystem::path& file, std::uint32_t dimension,
                  std::span<const double> positions, std::span<const std::uint32_t> segments,
                  std::span<const FieldView> fields) {
  if (dimension != 2 && dimension != 3)
    refuse(file, fmt::format("points have {} coordinates; must be 2 or 3", dimension));
  if (positions.size() % dimension != 0) {
    refuse(file,
           fmt::format("{} coordinates are no whole number of points of {}", positions.size(), dimension));
  }
  const std::size_t points = positions.size() / dimension;
  if (segments.size() % 2 != 0)
    refuse(file, fmt::format("{} ends are no whole number of segments", segments.size()));
  const auto outside =
      std::find_if(segments.begin(), segments.end(), [&](std::uint32_t n) { return n >= points; });
  if (outside != segments.end()) {
    refuse(file, fmt::format("segment {} ends at point {}; there are {} points",
                             (outside - segments.begin()) / 2, *outside, points));
  }
  check_fields(file, fields, points);

  const std::size_t corners = segments.empty() ? 1 : 2;
  const std::size_t cells = segments.empty() ? points : segments.size() / 2;
  std::vector<std::int64_t> connectivity(cells * corners);
  std::vector<std::int64_t> offsets(cells + 1);
  for (std::size_t i = 0; i < connectivity.size(); ++i) {
    connectivity[i] = segments.empty() ? static_cast<std::int64_t>(i) : std::int64_t{segments[i]};
  }
  for (std::size_t i = 0; i <= cells; ++i) offsets[i] = static_cast<std::int64_t>(i * corners);
  const std::vector<std::uint8_t> types(cells, segments.empty() ? vertex_cell : line_cell);

  FieldFile out(file, "UnstructuredGrid");
  const auto count = [&](const char* name, std::size_t value) {
    write_array(out.group(), file, name, H5T_STD_I64LE, H5T_NATIVE_INT64, {1}, &value);
  };
  count("NumberOfPoints", points);
  count("NumberOfCells", cells);
  count("NumberOfConnectivityIds", connectivity.size());
  write_array(out.group(), file, "Connectivity", H5T_STD_I64LE, H5T_NATIVE_INT64, {connectivity.size()},
              connectivity.data());
  write_array(out.group(), file, "Offsets", H5T_STD_I64LE, H5T_NATIVE_INT64, {offsets.size()},
              offsets.data());
  write_array(out.group(), file, "Types", H5T_STD_U8LE, H5T_NATIVE_UINT8, {cells}, types.data());
  std::vector<double> widened;
  widen(positions, dimension, 0, points, widened);
  write_array(out.group(), file, "Points", H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, {points, 3}, widened.data());
  auto point_data = create_group(out.group(), file, "PointData");
  for (const auto& field : fields) {
    widen(field.values, field.components, 0, points, widened);
    std::vector<hsize_t> extent{points};
    if (field.components > 1) extent.push_back(components_written(field.components));
    write_array(point_data.get(), file, field.name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, extent,
                widened.data());
  }
  point_data.close(file);
  out.finish();
}

FieldSeries::FieldSeries(std::filesystem::path folder, std::string name)
    : folder_(std::move(folder)), name_(std::move(name)) {
  // A resumed run goes on with the frames of the run before; an index that cannot be read is begun anew.
  std::ifstream stream(folder_ / (name_ + ".hdf.series"));
  const auto index = nlohmann::json::parse(stream, nullptr, false);
  if (!index.is_object() || !index.contains("files") || !index["files"].is_array()) return;
  for (const auto& entry : index["files"]) {
    if (entry.is_object() && entry.contains("name") && entry["name"].is_string() && entry.contains("time") &&
        entry["time"].is_number()) {
      frames_.emplace_back(entry["name"].get<std::string>(), entry["time"].get<double>());
    }
  }
}

std::string FieldSeries::file_name(std::uint64_t number) const {
  return fmt::format("{}-{:06}.hdf", name_, number);
}

void FieldSeries::add(std::uint64_t number, double time) {
  if (!std::isfinite(time))
    throw std::invalid_argument(fmt::format("frame {} has the time {}", number, time));
  // Frames at or after this one stem from what is now written anew. Longer names have larger numbers.
  const auto name = file_name(number);
  std::erase_if(frames_, [&](const auto& frame) {
    return frame.first.size() > name.size() || (frame.first.size() == name.size() && frame.first >= name);
  });
  frames_.emplace_back(name, time);

  nlohmann::ordered_json index{{"file-series-version", "1.0"}, {"files", nlohmann::ordered_json::array()}};
  for (const auto& [file, at] : frames_) index["files"].push_back({{"name", file}, {"time", at}});
  const auto path = folder_ / (name_ + ".hdf.series");
  const auto text = index.dump(1) + '\n';
  write_atomically(path, std::as_bytes(std::span(text)));
}

}  // namespace estuary
