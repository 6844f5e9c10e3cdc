// Files that a scene names or that a run left. ESTUARY_READER_image, _mesh, _sample, _checkpoint or _record
// says which.
#include <unistd.h>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

#if defined(ESTUARY_READER_image)
#include "image_file.hpp"

namespace {
void read(const std::filesystem::path& file) {
  const auto grey = estuary::read_grey_image(file);
  if (grey.values.size() != std::size_t(grey.width) * std::size_t(grey.height)) std::abort();
}
}  // namespace

#elif defined(ESTUARY_READER_mesh)
#include "mesh_file.hpp"

namespace {
void read(const std::filesystem::path& file) {
  const auto mesh = estuary::grains::read_stl(file);
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

#elif defined(ESTUARY_READER_checkpoint)
#include "checkpoint.hpp"

namespace {
void read(const std::filesystem::path& file) {
  const estuary::CheckpointReader reader(file);
  for (const char* name : {"displacement", "velocity", "state", "window"}) {
    try {
      (void)reader.read_count(name);
    } catch (const std::runtime_error&) {
    }
    try {
      (void)reader.read_all(name);
    } catch (const std::runtime_error&) {
    }
    try {
      (void)reader.read_bytes(name);
    } catch (const std::runtime_error&) {
    }
  }
}
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

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // In memory: no disk is slowed down or worn out.
  static const std::string file = "/dev/shm/estuary-fuzz-" + std::to_string(::getpid());
  static const bool removed_at_the_end = std::atexit([] { std::remove(file.c_str()); }) == 0;
  (void)removed_at_the_end;
  std::FILE* out = std::fopen(file.c_str(), "wb");
  if (out == nullptr) return 0;
  std::fwrite(data, 1, size, out);
  std::fclose(out);
  try {
    read(file);
  } catch (const std::runtime_error&) {
  } catch (const std::invalid_argument&) {
  }
  return 0;
}
