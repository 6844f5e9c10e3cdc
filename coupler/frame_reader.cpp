#include "frame_reader.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

namespace estuary::coupler {
namespace {

constexpr hsize_t most_values = 100'000'000;

/// Closes what HDF5 opened.
class Handle {
public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, hid_t{-1})), close_(other.close_) {}
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  Handle& operator=(Handle&&) = delete;
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  [[nodiscard]] hid_t get() const { return id_; }
  [[nodiscard]] bool valid() const { return id_ >= 0; }

private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// One open frame; messages name its file.
class Frame {
public:
  Frame(std::filesystem::path file, const std::string& type)
      : file_(std::move(file)),
        handle_(open(file_)),
        group_(H5Gopen2(handle_.get(), "VTKHDF", H5P_DEFAULT), H5Gclose) {
    if (!group_.valid()) fail("holds no VTKHDF data");
    if (type_of() != type) fail(fmt::format("is of type '{}'; expected {}", type_of(), type));
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(fmt::format("{}: {}", file_.string(), what));
  }
  [[nodiscard]] hid_t group() const { return group_.get(); }

  /// The numbers of an attribute.
  template <std::size_t count>
  [[nodiscard]] std::array<double, count> attribute(const char* name) const {
    const Handle attribute(H5Aopen(group_.get(), name, H5P_DEFAULT), H5Aclose);
    if (!attribute.valid()) fail(fmt::format("has no attribute '{}'", name));
    const Handle space(H5Aget_space(attribute.get()), H5Sclose);
    std::array<double, count> values{};
    if (H5Sget_simple_extent_npoints(space.get()) != static_cast<hssize_t>(count) ||
        H5Aread(attribute.get(), H5T_NATIVE_DOUBLE, values.data()) < 0) {
      fail(fmt::format("attribute '{}' is not {} numbers", name, count));
    }
    for (const double value : values) {
      if (!std::isfinite(value)) fail(fmt::format("attribute '{}' holds {}", name, value));
    }
    return values;
  }

  struct Array {
    std::vector<hsize_t> extent;
    std::vector<double> values;
  };
  /// All of an array when it is not too large; of the first axis only entry `plane` when one is given.
  [[nodiscard]] Array array(hid_t location, const std::string& name,
                            std::optional<hsize_t> plane = {}) const {
    const Handle dataset(H5Dopen2(location, name.c_str(), H5P_DEFAULT), H5Dclose);
    if (!dataset.valid()) fail(fmt::format("has no array '{}'", name));
    const Handle space(H5Dget_space(dataset.get()), H5Sclose);
    const int rank = H5Sget_simple_extent_ndims(space.get());
    if (rank < 1 || rank > 4) fail(fmt::format("array '{}' has {} axes", name, rank));
    Array result;
    result.extent.resize(static_cast<std::size_t>(rank));
    H5Sget_simple_extent_dims(space.get(), result.extent.data(), nullptr);
    if (plane) {
      if (*plane >= result.extent[0]) fail(fmt::format("array '{}' has no layer {}", name, *plane));
      std::vector<hsize_t> start(result.extent.size(), 0);
      start[0] = *plane;
      result.extent[0] = 1;
      if (H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start.data(), nullptr, result.extent.data(),
                              nullptr) < 0) {
        fail(fmt::format("array '{}' cannot be read", name));
      }
    }
    hsize_t count = 1;
    for (const hsize_t length : result.extent) {
      if (length != 0 && count > most_values / length)
        fail(fmt::format("array '{}' is too large for a picture", name));
      count *= length;
    }
    result.values.resize(count);
    const Handle memory(H5Screate_simple(rank, result.extent.data(), nullptr), H5Sclose);
    if (count > 0 && H5Dread(dataset.get(), H5T_NATIVE_DOUBLE, memory.get(), space.get(), H5P_DEFAULT,
                             result.values.data()) < 0) {
      fail(fmt::format("array '{}' cannot be read", name));
    }
    return result;
  }

  /// Names of the arrays on points.
  [[nodiscard]] std::vector<std::string> point_fields() const {
    std::vector<std::string> names;
    if (H5Lexists(group_.get(), "PointData", H5P_DEFAULT) <= 0) return names;
    const auto visit = [](hid_t, const char* name, const H5L_info_t*, void* target) -> herr_t {
      static_cast<std::vector<std::string>*>(target)->emplace_back(name);
      return 0;
    };
    const Handle data(H5Gopen2(group_.get(), "PointData", H5P_DEFAULT), H5Gclose);
    H5Literate(data.get(), H5_INDEX_NAME, H5_ITER_INC, nullptr, visit, &names);
    return names;
  }

private:
  static Handle open(const std::filesystem::path& file) {
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // what goes wrong is thrown, not printed
    Handle handle(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    if (!handle.valid()) throw std::runtime_error(fmt::format("{}: cannot be opened", file.string()));
    return handle;
  }

  [[nodiscard]] std::string type_of() const {
    const Handle attribute(H5Aopen(group_.get(), "Type", H5P_DEFAULT), H5Aclose);
    if (!attribute.valid()) return {};
    const Handle type(H5Aget_type(attribute.get()), H5Tclose);
    const Handle space(H5Aget_space(attribute.get()), H5Sclose);
    const std::size_t size = H5Tget_size(type.get());
    constexpr std::size_t longest = 64;
    if (H5Tget_class(type.get()) != H5T_STRING || H5Tis_variable_str(type.get()) > 0 || size > longest ||
        H5Sget_simple_extent_npoints(space.get()) != 1) {
      return {};
    }
    std::string text(size, '\0');
    if (H5Aread(attribute.get(), type.get(), text.data()) < 0) return {};
    return text.substr(0, text.find('\0'));
  }

  std::filesystem::path file_;
  Handle handle_;
  Handle group_;
};

std::vector<NamedFrame> frames_of(const std::filesystem::path& folder, const std::string& series) {
  std::vector<NamedFrame> frames;
  std::ifstream stream(folder / (series + ".hdf.series"));
  const auto index = nlohmann::json::parse(stream, nullptr, false);
  if (!index.is_object() || !index.contains("files") || !index["files"].is_array()) return frames;
  for (const auto& entry : index["files"]) {
    if (!entry.is_object() || !entry.value("name", nlohmann::json()).is_string()) continue;
    // The name comes from a file: only its last part counts, so that nothing outside of the folder is read.
    const auto file = folder / std::filesystem::path(entry["name"].get<std::string>()).filename();
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) continue;
    const auto time = entry.value("time", nlohmann::json());
    frames.push_back({.file = file, .time = time.is_number() ? time.get<double>() : 0.0});
  }
  return frames;
}

}  // namespace

std::optional<NamedFrame> last_frame(const std::filesystem::path& folder, const std::string& series) {
  const auto frames = frames_of(folder, series);
  return frames.empty() ? std::nullopt : std::optional(frames.back());
}

std::optional<NamedFrame> first_frame(const std::filesystem::path& folder, const std::string& series) {
  const auto frames = frames_of(folder, series);
  return frames.empty() ? std::nullopt : std::optional(frames.front());
}

ImageFrame read_image_frame(const std::filesystem::path& file) {
  const Frame frame(file, "ImageData");
  const auto extent = frame.attribute<6>("WholeExtent");
  const auto origin = frame.attribute<3>("Origin");
  const auto spacing = frame.attribute<3>("Spacing");
  std::array<std::size_t, 3> points{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double count = extent[2 * axis + 1] - extent[2 * axis] + 1;
    if (!(count >= 1 && count <= static_cast<double>(most_values)))
      frame.fail("has an impossible WholeExtent");
    points[axis] = static_cast<std::size_t>(count);
  }
  if (!(spacing[0] > 0) || std::abs(spacing[0] - spacing[1]) > 1e-9 * spacing[0]) {
    frame.fail("has a spacing that differs along x and y or is not positive");
  }
  ImageFrame image{.nx = points[0],
                   .ny = points[1],
                   .x0 = origin[0] + extent[0] * spacing[0],
                   .y0 = origin[1] + extent[2] * spacing[1],
                   .spacing = spacing[0],
                   .fields = {}};
  for (const auto& name : frame.point_fields()) {
    auto array = frame.array(frame.group(), "PointData/" + name, points[2] / 2);
    const std::size_t components = array.extent.size() == 4 ? array.extent[3] : 1;
    if (array.extent.size() < 3 || array.extent[1] != image.ny || array.extent[2] != image.nx ||
        components == 0) {
      frame.fail(fmt::format("field '{}' does not have the shape of the image", name));
    }
    image.fields[name] = {.components = components, .values = std::move(array.values)};
  }
  return image;
}

PointFrame read_point_frame(const std::filesystem::path& file) {
  const Frame frame(file, "UnstructuredGrid");
  PointFrame result;
  const auto points = frame.array(frame.group(), "Points");
  if (points.extent.size() != 2 || points.extent[1] != 3) frame.fail("'Points' are not three numbers each");
  const std::size_t count = points.extent[0];
  result.positions.resize(2 * count);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < 2; ++c) {
      result.positions[2 * i + c] = points.values[3 * i + c];
      if (!std::isfinite(points.values[3 * i + c])) frame.fail(fmt::format("point {} is not finite", i));
    }
  }
  const auto connectivity = frame.array(frame.group(), "Connectivity");
  const auto offsets = frame.array(frame.group(), "Offsets");
  const auto types = frame.array(frame.group(), "Types");
  constexpr double line_cell = 3;
  for (std::size_t cell = 0; cell < types.values.size(); ++cell) {
    if (types.values[cell] != line_cell) continue;
    if (cell + 1 >= offsets.values.size()) frame.fail("'Offsets' are fewer than the cells");
    const double first = offsets.values[cell];
    if (!(first >= 0 && first + 1 < static_cast<double>(connectivity.values.size())))
      frame.fail("'Offsets' point outside");
    for (const std::size_t end : {std::size_t{0}, std::size_t{1}}) {
      const double node = connectivity.values[static_cast<std::size_t>(first) + end];
      if (!(node >= 0 && node < static_cast<double>(count)))
        frame.fail("a line ends at a point that is not there");
      result.segments.push_back(static_cast<std::size_t>(node));
    }
  }
  for (const auto& name : frame.point_fields()) {
    auto array = frame.array(frame.group(), "PointData/" + name);
    const std::size_t components = array.extent.size() == 2 ? array.extent[1] : 1;
    if (array.extent.size() > 2 || array.extent[0] != count || components == 0) {
      frame.fail(fmt::format("field '{}' does not have one entry for each point", name));
    }
    result.fields[name] = {.components = components, .values = std::move(array.values)};
  }
  return result;
}

}  // namespace estuary::coupler
