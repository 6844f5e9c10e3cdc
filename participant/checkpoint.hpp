// Named arrays in one HDF5 file: what a participant needs to go on bit for bit.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace estuary {

/// Collects arrays in memory; `commit` writes them to a temporary file and renames it into place, so that a
/// crash or a full disk leaves the older file whole. Errors throw std::runtime_error naming the file.
class CheckpointWriter {
public:
  explicit CheckpointWriter(std::filesystem::path file);
  ~CheckpointWriter();
  CheckpointWriter(const CheckpointWriter&) = delete;
  CheckpointWriter& operator=(const CheckpointWriter&) = delete;
  void add(const std::string& name, std::span<const double> values);
  void add(const std::string& name, std::span<const std::uint8_t> values);
  void add(const std::string& name, std::uint64_t value);
  void add_bytes(const std::string& name, std::string_view bytes);
  void commit();

private:
  std::filesystem::path file_;
  std::int64_t handle_ = -1;
};

/// Reads them back; a missing array or one of another length throws std::runtime_error naming it.
class CheckpointReader {
public:
  explicit CheckpointReader(const std::filesystem::path& file);
  ~CheckpointReader();
  CheckpointReader(const CheckpointReader&) = delete;
  CheckpointReader& operator=(const CheckpointReader&) = delete;
  void read(const std::string& name, std::span<double> values) const;
  void read(const std::string& name, std::span<std::uint8_t> values) const;
  [[nodiscard]] std::uint64_t read_count(const std::string& name) const;
  [[nodiscard]] std::vector<double> read_all(const std::string& name) const;
  [[nodiscard]] std::string read_bytes(const std::string& name) const;

private:
  std::filesystem::path file_;
  std::int64_t handle_ = -1;
};

}  // namespace estuary
