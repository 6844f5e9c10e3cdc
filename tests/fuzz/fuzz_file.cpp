// Files that a scene names or that a run left. ESTUARY_READER_image, _mesh, _sample, _hdf5,
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

#elif defined(ESTUARY_READER_hdf5) || defined(ESTUARY_READER_digest)
#include <hdf5.h>

#include <cstring>

#include "checkpoint.hpp"
#include "crc32_by_bits.hpp"
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

#if defined(ESTUARY_READER_hdf5)
// As if its checksum were right, whatever it holds.
void read(const std::filesystem::path& file) {
  go_on_from(file);
}
#else
// As a participant is asked to: size and checksum as they were when it was written come first. What passes is
// given to HDF5, to which it is no file of its own.
constexpr std::size_t begin = sizeof(std::uint64_t) + sizeof(std::uint32_t);

// Of what follows size and checksum: the reader's own, zlib's, is not its own judge.
std::uint32_t right_sum(const std::uint8_t* data, std::size_t size) {
  return estuary::crc32_by_bits({reinterpret_cast<const char*>(data) + begin, size - begin});
}

void read(const std::filesystem::path& file, const std::uint8_t* data, std::size_t size) {
  estuary::FileSum said;
  std::memcpy(&said.bytes, data, sizeof said.bytes);
  std::memcpy(&said.crc32, data + sizeof said.bytes, sizeof said.crc32);
  const bool whole = said.bytes == size - begin && said.crc32 == right_sum(data, size);
  bool believed = true;
  try {
    estuary::require_sum(file, said);
  } catch (const std::runtime_error&) {
    believed = false;
  }
  if (believed != whole) std::abort();
  if (believed) go_on_from(file);
}
#endif
}  // namespace

#if defined(ESTUARY_READER_digest)
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

// Hardly any input has the right checksum by chance: a quarter of them is given it.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed) {
  size = LLVMFuzzerMutate(data, size, most);
  if (seed % 4 != 0 || size < begin) return size;
  const std::uint64_t bytes = size - begin;
  const std::uint32_t crc32 = right_sum(data, size);
  std::memcpy(data, &bytes, sizeof bytes);
  std::memcpy(data + sizeof bytes, &crc32, sizeof crc32);
  return size;
}
#endif

#else
#include <google/protobuf/stubs/logging.h>

#include "record_file.hpp"

namespace {
void read(const std::filesystem::path& file) {
  static const google::protobuf::LogSilencer silence;  // of what is no UTF-8
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
    read(file_of(data + begin, size - begin), data, size);
#else
    read(file_of(data, size));
#endif
  } catch (const std::runtime_error&) {
  } catch (const std::invalid_argument&) {
  }
#if defined(ESTUARY_READER_hdf5) || defined(ESTUARY_READER_digest)
  // What is left open is no leak to the sanitizer.
  if (H5Fget_obj_count(static_cast<hid_t>(H5F_OBJ_ALL), H5F_OBJ_ALL) != 0) std::abort();
#endif
  return 0;
}
