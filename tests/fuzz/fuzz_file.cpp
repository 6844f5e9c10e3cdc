// Files that a scene names or that a run left. ESTUARY_READER_image, _mesh, _sample, _checkpoint,
// _digest or _record says which.
#include <unistd.h>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

#if defined(ESTUARY_READER_image)
#include "image_file.hpp"

namespace {
void read(std::string_view bytes) {
  static const std::filesystem::path name = "image";
  const auto grey = estuary::grey_image_of(bytes, name);
  if (grey.values.size() != std::size_t(grey.width) * std::size_t(grey.height)) std::abort();
}
}  // namespace

#elif defined(ESTUARY_READER_mesh)
#include "mesh_file.hpp"

namespace {
void read(std::string_view bytes) {
  static const std::filesystem::path name = "mesh";
  const auto mesh = estuary::grains::stl_of(std::string(bytes), name);
  for (const auto node : mesh.triangle)
    if (3 * std::size_t{node} + 2 >= mesh.node.size()) std::abort();
}
}  // namespace

#elif defined(ESTUARY_READER_sample)
#include "sample.hpp"

namespace {
void read(const std::filesystem::path& file) {
  for (const int dimension : {2, 3}) {
    std::vector<double> position, radius;
    try {
      estuary::grains::read_sample(file, dimension, position, radius);
    } catch (const std::invalid_argument&) {
      continue;
    }
    if (position.size() != radius.size() * std::size_t(dimension)) std::abort();
  }
}
}  // namespace

#elif defined(ESTUARY_READER_checkpoint) || defined(ESTUARY_READER_digest)
#include <hdf5.h>

#include <cstring>

#include "checkpoint.hpp"
#include "file_digest.hpp"

namespace {
// For each file that it opens HDF5 asks for, and clears, half a megabyte; it shall keep it.
const bool keeps_its_memory = H5set_free_list_limits(-1, -1, -1, -1, -1, -1) >= 0;

void go_on_from(const std::filesystem::path& file) {
  const estuary::CheckpointReader reader(file);
  const auto attempt = [](auto&& what) {
    try {
      what();
    } catch (const std::runtime_error&) {
    }
  };
  attempt([&] { (void)reader.read_count("area"); });
  attempt([&] { (void)reader.read_all("velocity"); });
  attempt([&] { (void)reader.read_bytes("pressure"); });
}

#if defined(ESTUARY_READER_checkpoint)
// As if its checksum were right, whatever it holds.
void read(const std::filesystem::path& file) {
  go_on_from(file);
}
#else
// As a participant is asked to: size and checksum as they were when it was written come first.
constexpr std::size_t begin = sizeof(std::uint64_t) + sizeof(std::uint32_t);
void read(const std::filesystem::path& file, const std::uint8_t* said) {
  estuary::FileSum sum;
  std::memcpy(&sum.bytes, said, sizeof sum.bytes);
  std::memcpy(&sum.crc32, said + sizeof sum.bytes, sizeof sum.crc32);
  estuary::require_sum(file, sum);
  go_on_from(file);
}
#endif
}  // namespace

#else
#include "record_file.hpp"

namespace {
void read(const std::filesystem::path& file) {
  estuary::RecordReader reader(file);
  while (reader.next()) {
  }
}
}  // namespace
#endif

namespace {
#if !defined(ESTUARY_READER_image) && !defined(ESTUARY_READER_mesh)
// A file in memory, the same one for all inputs: no disk is slowed down or worn out. It has a name of its
// own, without which HDF5 does not open it.
const std::string& file_of(const std::uint8_t* data, std::size_t size) {
  static std::string name = "/dev/shm/estuary-fuzz-XXXXXX";
  static const int descriptor = [] {
    const int opened = ::mkstemp(name.data());
    if (opened < 0) std::abort();
    std::atexit([] { ::unlink(name.c_str()); });
    return opened;
  }();
  if (::ftruncate(descriptor, static_cast<off_t>(size)) != 0 ||
      ::pwrite(descriptor, data, size, 0) != static_cast<ssize_t>(size))
    std::abort();
  return name;
}
#endif
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
#if defined(ESTUARY_READER_image) || defined(ESTUARY_READER_mesh)
    read({reinterpret_cast<const char*>(data), size});
#elif defined(ESTUARY_READER_digest)
    if (size < begin) return 0;
    read(file_of(data + begin, size - begin), data);
#else
    read(file_of(data, size));
#endif
  } catch (const std::runtime_error&) {
  } catch (const std::invalid_argument&) {
  }
#if defined(ESTUARY_READER_checkpoint) || defined(ESTUARY_READER_digest)
  // What is left open is no leak to the sanitizer.
  if (H5Fget_obj_count(static_cast<hid_t>(H5F_OBJ_ALL), H5F_OBJ_ALL) != 0) std::abort();
#endif
  return 0;
}
