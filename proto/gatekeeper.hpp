// Says who may talk to the servers of this process: the handler of ZeroMQ's authentication protocol (ZAP,
// rfc.zeromq.org/spec/27). A client whose public key is not on the list is turned away before any of its
// messages is read.
#pragma once

#include <string>
#include <thread>
#include <vector>

namespace estuary {

class Gatekeeper {
public:
  /// `context`: of ZeroMQ; it can have one gatekeeper. `allowed`: public keys (Z85). Throws ChannelError.
  Gatekeeper(void* context, const std::vector<std::string>& allowed);
  ~Gatekeeper();
  Gatekeeper(const Gatekeeper&) = delete;
  Gatekeeper& operator=(const Gatekeeper&) = delete;

private:
  void answer();

  std::vector<std::string> allowed_;  // 32 bytes each
  void* socket_;
  int stop_;  // an event descriptor
  std::thread thread_;
};

}  // namespace estuary
