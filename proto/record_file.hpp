// What one participant was asked and what it answered, in one file: requests and replies in turn, each
// preceded by its length as a varint (the delimited form of Protocol Buffers).
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>

#include "estuary/v1/protocol.pb.h"

namespace estuary {

class RecordWriter {
public:
  /// Begins the file anew, or goes on at its end. Throws std::runtime_error when it cannot be written.
  explicit RecordWriter(std::filesystem::path path, bool go_on = false);
  /// Throws std::runtime_error when the disk is full.
  void add(const v1::Request& request, const v1::Reply& reply);
  /// Bytes so far, all of them written.
  [[nodiscard]] std::uint64_t position();
  /// Drops what came after `position`. Throws std::runtime_error when the file is shorter.
  void go_back(std::uint64_t position);

private:
  std::filesystem::path path_;
  std::ofstream file_;
};

class RecordReader {
public:
  /// Throws std::runtime_error when the file cannot be read.
  explicit RecordReader(std::filesystem::path path);

  struct Entry {
    v1::Request request;
    v1::Reply reply;
  };
  /// Where the next entry begins [bytes].
  [[nodiscard]] std::uint64_t position() const { return position_; }
  /// Nothing at the end of the file, and where a run that was ended left half an entry. Throws
  /// std::runtime_error for a file that is no record.
  std::optional<Entry> next();
  /// The entry that begins at a position that `position` gave.
  Entry at(std::uint64_t position);

private:
  std::filesystem::path path_;
  std::ifstream file_;
  std::uint64_t size_;
  std::uint64_t position_ = 0;
};

}  // namespace estuary
