#include "checkpoint.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "atomic_file.hpp"
#include "hdf5_handle.hpp"

namespace estuary {

namespace {

using hdf5::check;
using hdf5::fail;
using hdf5::Handle;

constexpr const char* marker = "estuary_checkpoint";
constexpr std::uint64_t layout_version = 1;
constexpr hsize_t chunk_length = hsize_t{1} << 16;

/// One-dimensional dataset with a checksum for each chunk, so that a damaged file is noticed when it is read.
void write_array(hid_t location, const std::filesystem::path& file, const std::string& name, hid_t file_type,
                 hid_t memory_type, const void* values, std::size_t length) {
  const auto what = fmt::format("array '{}' cannot be written", name);
  const hsize_t extent = length;
  const Handle space(check(H5Screate_simple(1, &extent, nullptr), file, what), H5Sclose);
  const Handle properties(check(H5Pcreate(H5P_DATASET_CREATE), file, what), H5Pclose);
  // The same values make the same file, whenever they are written.
  check(H5Pset_obj_track_times(properties.get(), false), file, what);
  if (length > 0) {
    const hsize_t chunk = std::min<hsize_t>(extent, chunk_length);
    check(H5Pset_chunk(properties.get(), 1, &chunk), file, what);
    check(H5Pset_fletcher32(properties.get()), file, what);
  }
  Handle dataset(check(H5Dcreate2(location, name.c_str(), file_type, space.get(), H5P_DEFAULT,
                                  properties.get(), H5P_DEFAULT),
                       file, what),
                 H5Dclose);
  if (length > 0) {
    check(H5Dwrite(dataset.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), file, what);
  }
  dataset.close(file);
}

Handle open_array(hid_t location, const std::filesystem::path& file, const std::string& name) {
  const auto present = check(H5Lexists(location, name.c_str(), H5P_DEFAULT), file,
                             fmt::format("array '{}' cannot be looked for", name));
  if (present == 0) {
    throw std::runtime_error(
        fmt::format("{}: has no array '{}'; it was written for another scene or by another version",
                    file.string(), name));
  }
  return {check(H5Dopen2(location, name.c_str(), H5P_DEFAULT), file,
                fmt::format("array '{}' cannot be opened", name)),
          H5Dclose};
}

std::size_t array_length(const Handle& dataset, const std::filesystem::path& file, const std::string& name) {
  const auto what = fmt::format("array '{}' has no readable shape", name);
  const Handle space(check(H5Dget_space(dataset.get()), file, what), H5Sclose);
  if (H5Sget_simple_extent_ndims(space.get()) != 1) fail(file, fmt::format("array '{}' is not a list", name));
  hsize_t extent = 0;
  check(H5Sget_simple_extent_dims(space.get(), &extent, nullptr), file, what);
  return static_cast<std::size_t>(extent);
}

// A damaged header may claim any length; what the file does not hold is not allocated.
std::size_t believable_length(const Handle& dataset, const std::filesystem::path& file,
                              const std::string& name, std::size_t bytes_each) {
  const auto length = array_length(dataset, file, name);
  if (length > std::filesystem::file_size(file) / bytes_each) {
    throw std::runtime_error(fmt::format("{}: array '{}' claims {} values, more than the file holds",
                                         file.string(), name, length));
  }
  return length;
}

void read_values(const Handle& dataset, const std::filesystem::path& file, const std::string& name,
                 hid_t memory_type, void* values, std::size_t length) {
  const auto what = fmt::format("array '{}' cannot be read", name);
  const Handle type(check(H5Dget_type(dataset.get()), file, what), H5Tclose);
  const Handle expected(check(H5Tcopy(memory_type), file, what), H5Tclose);
  if (H5Tget_class(type.get()) != H5Tget_class(expected.get()) ||
      H5Tget_size(type.get()) != H5Tget_size(expected.get())) {
    throw std::runtime_error(
        fmt::format("{}: array '{}' holds another type of number than expected", file.string(), name));
  }
  if (length == 0) return;
  check(H5Dread(dataset.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), file, what);
}

void read_exactly(hid_t location, const std::filesystem::path& file, const std::string& name,
                  hid_t memory_type, void* values, std::size_t length) {
  hdf5::throw_instead_of_print();
  const auto dataset = open_array(location, file, name);
  const auto stored = array_length(dataset, file, name);
  if (stored != length) {
    throw std::runtime_error(fmt::format(
        "{}: array '{}' has {} values; this scene needs {}. The checkpoint belongs to another scene",
        file.string(), name, stored, length));
  }
  read_values(dataset, file, name, memory_type, values, length);
}

void check_finite(std::span<const double> values, const std::filesystem::path& file,
                  const std::string& name) {
  const auto bad = std::find_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); });
  if (bad != values.end()) {
    throw std::runtime_error(fmt::format("{}: value {} of array '{}' is {}; a state to go on from is finite",
                                         file.string(), bad - values.begin(), name, *bad));
  }
}

}  // namespace

CheckpointWriter::CheckpointWriter(std::filesystem::path file) : file_(std::move(file)) {
  hdf5::throw_instead_of_print();
  Handle created = hdf5::create_in_memory(file_);
  const auto what = std::string("cannot be marked as a checkpoint");
  const Handle space(check(H5Screate(H5S_SCALAR), file_, what), H5Sclose);
  const Handle attribute(
      check(H5Acreate2(created.get(), marker, H5T_STD_U64LE, space.get(), H5P_DEFAULT, H5P_DEFAULT), file_,
            what),
      H5Aclose);
  check(H5Awrite(attribute.get(), H5T_NATIVE_UINT64, &layout_version), file_, what);
  handle_ = created.release();
}

CheckpointWriter::~CheckpointWriter() {
  if (handle_ >= 0) H5Fclose(handle_);
}

void CheckpointWriter::add(const std::string& name, std::span<const double> values) {
  hdf5::throw_instead_of_print();
  write_array(handle_, file_, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data(), values.size());
}

void CheckpointWriter::add(const std::string& name, std::span<const std::uint8_t> values) {
  hdf5::throw_instead_of_print();
  write_array(handle_, file_, name, H5T_STD_U8LE, H5T_NATIVE_UINT8, values.data(), values.size());
}

void CheckpointWriter::add(const std::string& name, std::uint64_t value) {
  hdf5::throw_instead_of_print();
  write_array(handle_, file_, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, &value, 1);
}

void CheckpointWriter::add_bytes(const std::string& name, std::string_view bytes) {
  add(name, std::span(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()));
}

void CheckpointWriter::commit() {
  if (handle_ < 0) throw std::runtime_error(fmt::format("{}: was committed before", file_.string()));
  hdf5::throw_instead_of_print();
  write_atomically(file_, hdf5::content_of(handle_, file_));
  const auto closed = H5Fclose(handle_);
  handle_ = -1;
  check(closed, file_, "cannot be closed");
}

CheckpointReader::CheckpointReader(const std::filesystem::path& file) : file_(file) {
  hdf5::throw_instead_of_print();
  Handle opened(check(H5Fopen(file_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), file_, "cannot be opened"),
                H5Fclose);
  if (H5Aexists(opened.get(), marker) <= 0) {
    throw std::runtime_error(fmt::format("{}: is not a checkpoint", file_.string()));
  }
  const auto what = std::string("has no readable version");
  const Handle attribute(check(H5Aopen(opened.get(), marker, H5P_DEFAULT), file_, what), H5Aclose);
  const Handle space(check(H5Aget_space(attribute.get()), file_, what), H5Sclose);
  if (H5Sget_simple_extent_npoints(space.get()) != 1) fail(file_, what);
  std::uint64_t version = 0;
  check(H5Aread(attribute.get(), H5T_NATIVE_UINT64, &version), file_, what);
  if (version != layout_version) {
    throw std::runtime_error(fmt::format("{}: is a checkpoint of version {}; this program reads version {}",
                                         file_.string(), version, layout_version));
  }
  handle_ = opened.release();
}

CheckpointReader::~CheckpointReader() {
  if (handle_ >= 0) H5Fclose(handle_);
}

void CheckpointReader::read(const std::string& name, std::span<double> values) const {
  read_exactly(handle_, file_, name, H5T_NATIVE_DOUBLE, values.data(), values.size());
  check_finite(values, file_, name);
}

void CheckpointReader::read(const std::string& name, std::span<std::uint8_t> values) const {
  read_exactly(handle_, file_, name, H5T_NATIVE_UINT8, values.data(), values.size());
}

std::uint64_t CheckpointReader::read_count(const std::string& name) const {
  std::uint64_t value = 0;
  read_exactly(handle_, file_, name, H5T_NATIVE_UINT64, &value, 1);
  return value;
}

std::string CheckpointReader::read_bytes(const std::string& name) const {
  hdf5::throw_instead_of_print();
  const auto dataset = open_array(handle_, file_, name);
  std::string bytes(believable_length(dataset, file_, name, 1), '\0');
  read_values(dataset, file_, name, H5T_NATIVE_UINT8, bytes.data(), bytes.size());
  return bytes;
}

std::vector<double> CheckpointReader::read_all(const std::string& name) const {
  hdf5::throw_instead_of_print();
  const auto dataset = open_array(handle_, file_, name);
  const auto length = believable_length(dataset, file_, name, sizeof(double));
  std::vector<double> values(length);
  read_values(dataset, file_, name, H5T_NATIVE_DOUBLE, values.data(), length);
  check_finite(values, file_, name);
  return values;
}

}  // namespace estuary
