// CurveZMQ key pairs and their files: who a participant is, and whom it talks to.
//
//   NAME.key   the pair, secret part included; readable by its owner only
//   NAME.pub   the public part, for the others
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace estuary {

struct KeyError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Both as 40 printable characters (Z85).
struct CurvePair {
  std::string public_key;
  std::string secret_key;
};

[[nodiscard]] CurvePair new_curve_pair();

/// Writes `base`.key (0600) and `base`.pub. Throws KeyError when one of them is there already, or cannot be
/// written.
void write_key_files(const std::filesystem::path& base, const CurvePair& pair);

/// Throws KeyError naming the file when it is no key file, holds no valid key, or (a pair) can be read by
/// others than its owner. Never says what is in it.
[[nodiscard]] CurvePair read_pair(const std::filesystem::path& file);
[[nodiscard]] std::string read_public_key(const std::filesystem::path& file);

/// What a channel needs that other machines can reach.
struct ServerSecurity {
  bool insecure = false;                  // without keys all the same
  CurvePair own = {};                     // empty: without keys
  std::vector<std::string> allowed = {};  // public keys of clients
  [[nodiscard]] bool has_keys() const { return !own.secret_key.empty(); }
};
struct ClientSecurity {
  bool insecure = false;
  CurvePair own = {};
  std::string server_key = {};  // public key of the one that is to answer
  [[nodiscard]] bool has_keys() const { return !own.secret_key.empty() && !server_key.empty(); }
};

}  // namespace estuary
