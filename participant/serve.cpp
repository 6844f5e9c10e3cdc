#include "serve.hpp"

#include <fmt/format.h>
#include <omp.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <iostream>
#include <iterator>
#include <thread>

#include "channel.hpp"
#include "conversation.hpp"
#include "request_queue.hpp"
#include "session.hpp"

namespace estuary {
namespace {

using std::chrono::steady_clock;

// Time a phase method gets to notice that it should stop, once nobody waits for its result any more.
constexpr std::chrono::seconds grace_after_loss{2};

std::atomic<bool> terminate_requested{false};
void on_signal(int /*signal*/) {
  terminate_requested = true;
}

// The thread that owns the socket.
class Reception {
public:
  Reception(ServerChannel& channel, RequestQueue& queue, Conversation& conversation, ProgressBoard& board,
            const Identity& identity, double orphan_timeout, double reconnect_timeout)
      : channel_(channel),
        queue_(queue),
        conversation_(conversation),
        board_(board),
        identity_(identity),
        orphan_timeout_(orphan_timeout),
        reconnect_timeout_(reconnect_timeout),
        born_(steady_clock::now()),
        last_progress_(born_) {}

  // Returns when the run was stopped (true) or nobody is there to serve (false).
  bool run() {
    while (true) {
      if (auto incoming = channel_.receive(until_next_progress())) receive(std::move(*incoming));
      report_refusals();
      while (const auto reply = queue_.take_reply()) {
        if (!tell_owner(*reply)) return false;
        if (conversation_.ends_with(*reply)) return true;
      }
      if (!report_progress()) return false;
      if (terminate_requested) {
        spdlog::warn("told to end by a signal");
        return false;
      }
      if (owner_.empty() && orphan_timeout_ > 0 &&
          std::chrono::duration<double>(steady_clock::now() - born_).count() > orphan_timeout_) {
        spdlog::error("nobody asked for anything in {} s", orphan_timeout_);
        return false;
      }
    }
  }

private:
  std::chrono::milliseconds until_next_progress() const {
    const auto due = last_progress_ + progress_interval - steady_clock::now();
    return std::max(std::chrono::milliseconds(0), std::chrono::duration_cast<std::chrono::milliseconds>(due) +
                                                      std::chrono::milliseconds(1));
  }

  void refuse(const std::string& client, const v1::Header& header, v1::Error::Kind kind,
              const std::string& message) {
    spdlog::warn("refused a request: {}", message);
    (void)channel_.send(client, refusal(header, kind, message));
  }

  void welcome(const std::string& client, const v1::Header& header) {
    v1::Reply reply;
    *reply.mutable_header() = header;
    auto* welcome = reply.mutable_welcome();
    welcome->set_name(identity_.name);
    welcome->set_version(identity_.version);
    for (const auto& role : identity_.roles) welcome->add_roles(role);
    for (const auto& capability : identity_.capabilities) welcome->add_capabilities(capability);
    welcome->add_capabilities("advance-accepts");  // by Session, for every participant
    if (queue_.offers_direct_line()) {
      welcome->add_capabilities("direct-line");
      welcome->add_capabilities("shared-ring");
    }
    for (const auto dimension : identity_.dimensions) welcome->add_dimensions(dimension);
    welcome->set_process(static_cast<std::uint64_t>(::getpid()));
    welcome->set_run_id(conversation_.run_id());
    (void)channel_.send(client, reply);
  }

  void receive(ServerChannel::Incoming incoming) {
    if (!incoming.request) {
      refuse(incoming.client, {}, v1::Error::BAD_MESSAGE, "the bytes are not a request of this protocol");
      return;
    }
    v1::Request& request = *incoming.request;
    const v1::Header header = request.header();
    if (request.has_hello() && header.protocol_version() == protocol_version) {
      welcome(incoming.client, header);
      return;
    }
    const Conversation::Judgement judgement = conversation_.judge(request);
    if (judgement.course == Conversation::Course::refuse) {
      refuse(incoming.client, header, judgement.kind, judgement.message);
      return;
    }
    if (owner_.empty()) spdlog::info("serves run {}", header.run_id());
    owner_ = incoming.client;
    out_of_reach_since_.reset();
    if (judgement.course == Conversation::Course::repeat)
      (void)channel_.send(owner_, *conversation_.last_reply());
    if (judgement.course != Conversation::Course::carry_out) return;
    if (judgement.interrupts) board_.request_stop();
    queue_.put_request(std::move(request));
  }

  // Each at first, then seldom: somebody may try for hours.
  void report_refusals() {
    if (channel_.refused() < next_refusal_) return;
    spdlog::warn("refused a connection: {} ({} so far)", channel_.last_refusal(), channel_.refused());
    next_refusal_ = channel_.refused() < 10 ? channel_.refused() + 1 : 2 * channel_.refused();
  }

  // False when there is nobody to tell any more. One whose connection broke may come back; it asks again for
  // what was lost with it.
  bool tell_owner(const v1::Reply& reply) {
    const auto now = steady_clock::now();
    if (channel_.send(owner_, reply)) {
      if (out_of_reach_since_) {
        spdlog::info("the coupler is back after {:.1f} s",
                     std::chrono::duration<double>(now - *out_of_reach_since_).count());
      }
      out_of_reach_since_.reset();
      return true;
    }
    if (!out_of_reach_since_) {
      if (reconnect_timeout_ > 0)
        spdlog::warn("the coupler of run {} is out of reach", conversation_.run_id());
      out_of_reach_since_ = now;
    }
    if (std::chrono::duration<double>(now - *out_of_reach_since_).count() < reconnect_timeout_) return true;
    spdlog::error("the coupler of run {} is gone", conversation_.run_id());
    return false;
  }

  bool report_progress() {
    const auto now = steady_clock::now();
    if (owner_.empty() || now - last_progress_ < progress_interval) return true;
    last_progress_ = now;
    v1::Reply reply;
    *reply.mutable_header() = conversation_.header_under_way();
    const auto snapshot = board_.snapshot();
    auto* progress = reply.mutable_progress();
    progress->set_phase(snapshot.phase);
    progress->set_fraction(snapshot.fraction);
    progress->set_counter(snapshot.counter);
    progress->set_note(snapshot.note);
    return tell_owner(reply);
  }

  ServerChannel& channel_;
  RequestQueue& queue_;
  Conversation& conversation_;
  ProgressBoard& board_;
  const Identity& identity_;
  double orphan_timeout_;
  double reconnect_timeout_;  // [s]
  std::optional<steady_clock::time_point> out_of_reach_since_;
  steady_clock::time_point born_;
  steady_clock::time_point last_progress_;
  std::string owner_;
  std::uint64_t next_refusal_ = 1;
};

// The process before, which the coupler gave up, may need a moment to leave the port.
std::unique_ptr<ServerChannel> bind_to(const std::string& endpoint, const ServerSecurity& security) {
  constexpr std::chrono::seconds patience{12};
  const auto deadline = steady_clock::now() + patience;
  while (true) {
    try {
      return std::make_unique<ServerChannel>(endpoint, security);
    } catch (const AddressInUse&) {
      if (steady_clock::now() > deadline) throw;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
}

int check_only(Participant& participant) {
  const std::string bytes{std::istreambuf_iterator<char>(std::cin), {}};
  v1::Configure request;
  if (!request.ParseFromString(bytes)) {
    std::cerr << "--check expects a Configure message on standard input\n";
    return 2;
  }
  const v1::Configured configured = configure(participant, request);
  configured.SerializeToOstream(&std::cout);
  return configured.problems().empty() ? 0 : 2;
}

}  // namespace

int serve(int argc, char** argv, std::unique_ptr<Participant> participant) {
  const Identity identity = participant->identity();
  CLI::App app{fmt::format("{} {}: a participant in an Estuary run", identity.name, identity.version)};
  std::string endpoint;
  std::string folder = ".";
  int threads = 0;
  double orphan_timeout = 0;
  double reconnect_timeout = std::chrono::duration<double>(reconnect_within).count();
  bool check = false;
  ServerSecurity security;
  std::string key;
  std::vector<std::string> allowed;
  app.add_option("--bind", endpoint, "Address to serve at, ipc:///path or tcp://host:port");
  app.add_option("--folder", folder, "Folder for the files it writes")->capture_default_str();
  app.add_option("--threads", threads, "Threads to compute with; all cores when not given");
  app.add_option("--orphan-timeout", orphan_timeout, "End after so many seconds without a coupler; 0: never");
  app.add_option("--reconnect-timeout", reconnect_timeout,
                 "End after so many seconds without a connection to the coupler of a run (tcp:// only)")
      ->capture_default_str();
  app.add_flag("--check", check, "Check the scene on standard input (a Configure message) and end");
  app.add_option("--key", key, "File of the own CurveZMQ key pair (made by `coupler keys`)");
  app.add_option("--allow", allowed, "File of the public key of a coupler that may come; may be repeated");
  app.add_flag("--insecure", security.insecure,
               "Allow an address that other machines reach, without authentication");
  app.set_version_flag("--version", identity.version);
  try {
    app.parse(argc, argv);
    if (!check && endpoint.empty()) throw CLI::RequiredError("--bind");
    if (key.empty() != allowed.empty()) throw CLI::ValidationError("--key and --allow belong together");
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (threads > 0) omp_set_num_threads(threads);
  if (check) return check_only(*participant);

  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  spdlog::set_pattern("%Y-%m-%d %H:%M:%S.%e %l %v");
  try {
    std::filesystem::create_directories(folder);
    if (!key.empty()) security.own = read_pair(key);
    for (const auto& file : allowed) security.allowed.push_back(read_public_key(file));
    const auto bound = bind_to(endpoint, security);
    ServerChannel& channel = *bound;
    if (!is_local(endpoint) && !security.has_keys())
      spdlog::warn("INSECURE: {} takes requests from anyone who reaches it", endpoint);
    spdlog::info("{} {} at {}, {} threads", identity.name, identity.version, channel.bound_endpoint(),
                 omp_get_max_threads());
    ProgressBoard board;
    Conversation conversation;
    RequestQueue queue(endpoint, conversation);
    const bool same_machine = endpoint.starts_with("ipc://");
    Reception reception(channel, queue, conversation, board, identity, orphan_timeout,
                        same_machine ? 0.0 : reconnect_timeout);
    std::atomic<bool> computing_ended{false};
    bool stopped_properly = false;
    std::thread receiver([&] {
      try {
        stopped_properly = reception.run();
      } catch (const std::exception& error) {
        spdlog::error("channel: {}", error.what());
      }
      if (stopped_properly) return;
      queue.close();  // first, so that what it interrupts is told from what was asked to stop
      board.request_stop();
      const auto deadline = steady_clock::now() + grace_after_loss;
      while (!computing_ended && steady_clock::now() < deadline) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      if (!computing_ended) {
        spdlog::error("computing does not stop; ending all the same");
        std::_Exit(1);
      }
    });

    // Whoever can enter a local socket may read what this process may read; others not.
    Session session(*participant, folder, board, !same_machine);
    while (const auto request = queue.next()) {
      board.begin_phase(phase_name(*request));
      const auto reply = std::make_shared<const v1::Reply>(session.answer(*request));
      board.begin_phase("idle");
      // Nobody asked for what a signal interrupted: the coupler takes this process for lost, and may go on.
      if (reply->has_error() && queue.closed()) break;
      if (reply->has_error()) {
        spdlog::error("{}, window {} iteration {}: {} {}", phase_name(*request), request->header().window(),
                      request->header().iteration(), reply->error().field(), reply->error().message());
      }
      if (queue.reply(reply)) channel.wake();
      if (session.stopped()) break;
    }
    computing_ended = true;
    receiver.join();
    spdlog::info("ends");
    return stopped_properly ? 0 : 1;
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
    return 1;
  }
}

}  // namespace estuary
