#include "record_file.hpp"

#include <fmt/format.h>
#include <google/protobuf/util/delimited_message_util.h>

#include <array>
#include <stdexcept>
#include <string>

#include "channel.hpp"

namespace estuary {

RecordWriter::RecordWriter(std::filesystem::path path, bool go_on)
    : path_(std::move(path)), file_(path_, go_on ? std::ios::binary | std::ios::app : std::ios::binary) {
  if (!file_) throw std::runtime_error(fmt::format("cannot write {}", path_.string()));
}

void RecordWriter::add(const v1::Request& request, const v1::Reply& reply) {
  const bool written = google::protobuf::util::SerializeDelimitedToOstream(request, &file_) &&
                       google::protobuf::util::SerializeDelimitedToOstream(reply, &file_);
  // An accepted window is on the disk, whatever happens later.
  if (request.has_accept() || request.advance().accept()) file_.flush();
  if (!written || !file_)
    throw std::runtime_error(fmt::format("cannot write {}: is the disk full?", path_.string()));
}

std::uint64_t RecordWriter::position() {
  file_.flush();
  return std::filesystem::file_size(path_);
}

void RecordWriter::go_back(std::uint64_t position) {
  file_.close();
  if (std::filesystem::file_size(path_) < position)
    throw std::runtime_error(fmt::format("{} is shorter than it was", path_.string()));
  std::filesystem::resize_file(path_, position);
  file_.open(path_, std::ios::binary | std::ios::app);
  if (!file_) throw std::runtime_error(fmt::format("cannot write {}", path_.string()));
}

RecordReader::RecordReader(std::filesystem::path path)
    : path_(std::move(path)), file_(path_, std::ios::binary) {
  std::error_code failed;
  size_ = std::filesystem::file_size(path_, failed);
  if (!file_ || failed) throw std::runtime_error(fmt::format("cannot read the record {}", path_.string()));
}

namespace {

enum class Read { whole, incomplete, nonsense };

// One message and its length. `left`: bytes there are; lowered by what was read.
template <typename Message>
Read read_message(std::ifstream& file, std::uint64_t& left, Message& message) {
  std::uint64_t length = 0;
  for (int shift = 0;; shift += 7) {
    const int byte = file.get();
    if (byte == std::ifstream::traits_type::eof()) return Read::incomplete;
    --left;
    length |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
    if ((byte & 0x80) == 0) break;
    if (shift >= 28) return Read::nonsense;
  }
  if (length > static_cast<std::uint64_t>(maximum_message_bytes)) return Read::nonsense;
  if (length > left) return Read::incomplete;
  std::string bytes(length, '\0');
  if (!file.read(bytes.data(), static_cast<std::streamsize>(length))) return Read::incomplete;
  left -= length;
  return message.ParseFromString(bytes) ? Read::whole : Read::nonsense;
}

}  // namespace

std::optional<RecordReader::Entry> RecordReader::next() {
  file_.clear();
  file_.seekg(static_cast<std::streamoff>(position_));
  std::uint64_t left = size_ - position_;
  Entry entry;
  Read read = read_message(file_, left, entry.request);
  if (read == Read::whole) read = read_message(file_, left, entry.reply);
  if (read == Read::incomplete) return std::nullopt;
  if (read == Read::nonsense || entry.request.phase_case() == v1::Request::PHASE_NOT_SET)
    throw std::runtime_error(
        fmt::format("{} is not a record of a participant (at byte {})", path_.string(), position_));
  position_ = size_ - left;
  return entry;
}

RecordReader::Entry RecordReader::at(std::uint64_t position) {
  position_ = position;
  auto entry = next();
  if (!entry) throw std::runtime_error(fmt::format("{} was shortened while it was read", path_.string()));
  return std::move(*entry);
}

}  // namespace estuary
