// Owns HDF5 identifiers and turns HDF5's return codes into exceptions that name the file.
#pragma once

#include <fmt/format.h>
#include <hdf5.h>

#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

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

/// An HDF5 file that lives in memory; `name` is used in messages. HDF5 1.10 crashes at the end of a program
/// that could not write a file to a full disk, so it is never let near one.
inline Handle create_in_memory(const std::filesystem::path& name) {
  constexpr std::size_t growth = std::size_t{4} << 20;
  const std::string what = "cannot be prepared";
  const Handle access(check(H5Pcreate(H5P_FILE_ACCESS), name, what), H5Pclose);
  check(H5Pset_fapl_core(access.get(), growth, false), name, what);
  return {check(H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.get()), name, what), H5Fclose};
}

/// The bytes of a file in memory.
inline std::vector<std::byte> content_of(hid_t file, const std::filesystem::path& name) {
  const std::string what = "cannot be completed";
  check(H5Fflush(file, H5F_SCOPE_GLOBAL), name, what);
  const auto size = check(H5Fget_file_image(file, nullptr, 0), name, what);
  std::vector<std::byte> content(static_cast<std::size_t>(size));
  check(H5Fget_file_image(file, content.data(), content.size()), name, what);
  return content;
}

}  // namespace estuary::hdf5
