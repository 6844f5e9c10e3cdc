#include "curve_keys.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zmq.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "toml.hpp"

namespace estuary {
namespace {

constexpr std::size_t key_characters = 40;
constexpr std::size_t key_bytes = 32;

std::filesystem::path with_ending(const std::filesystem::path& base, const char* ending) {
  auto file = base;
  file += ending;
  return file;
}

void write_new_file(const std::filesystem::path& file, const std::string& text, mode_t mode) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  if (descriptor < 0)
    throw KeyError(fmt::format("{}: cannot be made: {}", file.string(), std::strerror(errno)));
  const bool written = ::write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  if (::close(descriptor) != 0 || !written) {
    ::unlink(file.c_str());
    throw KeyError(fmt::format("{}: cannot be written", file.string()));
  }
}

std::string key_in(const toml::table& table, const char* name, const std::filesystem::path& file) {
  const std::string text = table[name].value_or(std::string());
  std::array<std::uint8_t, key_bytes> bytes{};
  if (text.size() != key_characters || ::zmq_z85_decode(bytes.data(), text.c_str()) == nullptr)
    throw KeyError(fmt::format("{}: holds no `{}` of {} characters", file.string(), name, key_characters));
  return text;
}

toml::table table_of(const std::filesystem::path& file) {
  std::error_code missing;
  constexpr std::uintmax_t largest = 4096;
  const auto size = std::filesystem::file_size(file, missing);
  if (missing) throw KeyError(fmt::format("{}: {}", file.string(), missing.message()));
  if (size > largest) throw KeyError(fmt::format("{}: is no key file", file.string()));
  std::ifstream stream(file);
  if (!stream) throw KeyError(fmt::format("{}: cannot be read", file.string()));
  try {
    return toml::parse(stream);
  } catch (const toml::parse_error&) {
    // Its message may quote what is in the file.
    throw KeyError(fmt::format("{}: is no key file", file.string()));
  }
}

}  // namespace

CurvePair new_curve_pair() {
  std::array<char, key_characters + 1> public_key{};
  std::array<char, key_characters + 1> secret_key{};
  if (::zmq_curve_keypair(public_key.data(), secret_key.data()) != 0)
    throw KeyError(fmt::format("no key pair can be made: {}", ::zmq_strerror(::zmq_errno())));
  return {public_key.data(), secret_key.data()};
}

void write_key_files(const std::filesystem::path& base, const CurvePair& pair) {
  const auto secret = with_ending(base, ".key");
  const auto open = with_ending(base, ".pub");
  if (std::filesystem::exists(open)) throw KeyError(fmt::format("{}: is there already", open.string()));
  const std::string line = fmt::format("public_key = \"{}\"\n", pair.public_key);
  write_new_file(secret,
                 "# Estuary: CurveZMQ key pair. Keep it to yourself; give others the file .pub.\n" + line +
                     fmt::format("secret_key = \"{}\"\n", pair.secret_key),
                 S_IRUSR | S_IWUSR);
  write_new_file(open, "# Estuary: CurveZMQ public key.\n" + line, S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH);
}

CurvePair read_pair(const std::filesystem::path& file) {
  struct stat state {};
  if (::stat(file.c_str(), &state) != 0)
    throw KeyError(fmt::format("{}: {}", file.string(), std::strerror(errno)));
  if ((state.st_mode & (S_IRWXG | S_IRWXO)) != 0)
    throw KeyError(
        fmt::format("{}: others than its owner can get at this secret; chmod 600 it", file.string()));
  const toml::table table = table_of(file);
  return {key_in(table, "public_key", file), key_in(table, "secret_key", file)};
}

std::string read_public_key(const std::filesystem::path& file) {
  return key_in(table_of(file), "public_key", file);
}

}  // namespace estuary
