// Owns HDF5 identifiers and turns HDF5's return codes into exceptions that name the file.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>

namespace estuary::hdf5 {

/// HDF5's own description of what went wrong last on this thread, or nothing.
inline std::string last_error() {
  std::string innermost;
  const auto visit = [](unsigned, const H5E_error2_t* error, void* target) -> herr_t {
    if (error->desc != nullptr && *error->desc != '\0') *static_cast<std::string*>(target) = error->desc;
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_DOWNWARD, visit, &innermost);
  return innermost;
}

[[noreturn]] inline void fail(const std::filesystem::path& file, const std::string& what) {
  const auto reason = last_error();
  H5Eclear2(H5E_DEFAULT);
  throw std::runtime_error(
      fmt::format("{}: {}{}{}", file.string(), what, reason.empty() ? "" : ": ", reason));
}

/// Passes on a return code or an identifier that is not negative.
template <typename Code>
Code check(Code code, const std::filesystem::path& file, const std::string& what) {
  if (code < 0) fail(file, what);
  return code;
}

/// HDF5 prints its errors to stderr unless told not to; they are thrown here instead. Once per thread that
/// uses HDF5.
inline void throw_instead_of_print() {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

/// One identifier and the function that closes it. `close` checks; the destructor is for the ways out by
/// exception.
class Handle {
public:
  Handle() = default;
  Handle(hid_t id, herr_t (*close_function)(hid_t)) : id_(id), close_(close_function) {}
  Handle(Handle&& other) noexcept
      : id_(std::exchange(other.id_, hid_t{-1})), close_(std::exchange(other.close_, nullptr)) {}
  Handle& operator=(Handle&&) = delete;
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  [[nodiscard]] hid_t get() const { return id_; }
  /// Gives the identifier to a caller who closes it.
  [[nodiscard]] hid_t release() { return std::exchange(id_, hid_t{-1}); }
  void close(const std::filesystem::path& file) {
    if (id_ >= 0) check(close_(std::exchange(id_, hid_t{-1})), file, "cannot be closed");
  }

private:
  hid_t id_ = -1;
  herr_t (*close_)(hid_t) = nullptr;
};

/// Puts a finished temporary file in the place of `file`, on the disk before it takes the name.
inline void rename_into_place(const std::filesystem::path& temporary, const std::filesystem::path& file) {
  const int descriptor = ::open(temporary.c_str(), O_RDONLY | O_CLOEXEC);
  const bool synced = descriptor >= 0 && ::fsync(descriptor) == 0;
  const int sync_error = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!synced) {
    throw std::runtime_error(
        fmt::format("{}: cannot be written to disk: {}", temporary.string(), std::strerror(sync_error)));
  }
  std::error_code error;
  std::filesystem::rename(temporary, file, error);
  if (error) {
    throw std::runtime_error(fmt::format("{}: cannot be put in place: {}", file.string(), error.message()));
  }
}

inline std::filesystem::path temporary_of(const std::filesystem::path& file) {
  auto temporary = file;
  temporary += ".part";
  return temporary;
}

}  // namespace estuary::hdf5
