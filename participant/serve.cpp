#include "serve.hpp"

#include <fmt/format.h>
#include <omp.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <deque>
#include <iostream>
#include <iterator>
#include <thread>

#include "channel.hpp"
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

// Where the two threads meet: requests go to the computing thread, replies come back.
class Mailbox {
public:
  void put_request(v1::Request request) {
    {
      const std::lock_guard lock(mutex_);
      requests_.push_back(std::move(request));
    }
    arrived_.notify_one();
  }
  // Empty when the process is to end.
  std::optional<v1::Request> take_request() {
    std::unique_lock lock(mutex_);
    arrived_.wait(lock, [this] { return closed_ || !requests_.empty(); });
    if (requests_.empty()) return std::nullopt;
    v1::Request request = std::move(requests_.front());
    requests_.pop_front();
    return request;
  }
  void put_reply(v1::Reply reply) {
    const std::lock_guard lock(mutex_);
    replies_.push_back(std::move(reply));
  }
  std::optional<v1::Reply> take_reply() {
    const std::lock_guard lock(mutex_);
    if (replies_.empty()) return std::nullopt;
    v1::Reply reply = std::move(replies_.front());
    replies_.pop_front();
    return reply;
  }
  void close() {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
    }
    arrived_.notify_one();
  }

private:
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<v1::Request> requests_;
  std::deque<v1::Reply> replies_;
  bool closed_ = false;
};

// The thread that owns the socket.
class Reception {
public:
  Reception(ServerChannel& channel, Mailbox& mailbox, ProgressBoard& board, const Identity& identity,
            double orphan_timeout)
      : channel_(channel),
        mailbox_(mailbox),
        board_(board),
        identity_(identity),
        orphan_timeout_(orphan_timeout),
        born_(steady_clock::now()),
        last_progress_(born_) {}

  // Returns when the run was stopped (true) or nobody is there to serve (false).
  bool run() {
    while (true) {
      if (auto incoming = channel_.receive(until_next_progress())) receive(std::move(*incoming));
      while (auto reply = mailbox_.take_reply()) {
        if (!send_reply(std::move(*reply))) return false;
        if (stop_answered_) return true;
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
    v1::Reply reply;
    *reply.mutable_header() = header;
    reply.mutable_header()->set_protocol_version(protocol_version);
    reply.mutable_error()->set_kind(kind);
    reply.mutable_error()->set_message(message);
    spdlog::warn("refused a request: {}", message);
    (void)channel_.send(client, reply);
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
    for (const auto dimension : identity_.dimensions) welcome->add_dimensions(dimension);
    welcome->set_process(static_cast<std::uint64_t>(::getpid()));
    welcome->set_run_id(run_id_);
    (void)channel_.send(client, reply);
  }

  void receive(ServerChannel::Incoming incoming) {
    if (!incoming.request) {
      refuse(incoming.client, {}, v1::Error::BAD_MESSAGE, "the bytes are not a request of this protocol");
      return;
    }
    v1::Request& request = *incoming.request;
    const v1::Header header = request.header();
    if (header.protocol_version() != protocol_version) {
      refuse(incoming.client, header, v1::Error::VERSION,
             fmt::format("the request speaks protocol version {}, this participant {}",
                         header.protocol_version(), protocol_version));
      return;
    }
    if (request.has_hello()) {
      welcome(incoming.client, header);
      return;
    }
    if (header.run_id().empty()) {
      refuse(incoming.client, header, v1::Error::BAD_MESSAGE,
             "the request belongs to no run (run_id is empty)");
      return;
    }
    if (run_id_.empty()) {
      run_id_ = header.run_id();
      spdlog::info("serves run {}", run_id_);
    } else if (header.run_id() != run_id_) {
      refuse(incoming.client, header, v1::Error::BUSY, fmt::format("busy with run {}", run_id_));
      return;
    }
    owner_ = incoming.client;
    if (header.sequence() == last_reply_.header().sequence() && last_reply_.result_case() != 0) {
      (void)channel_.send(owner_, last_reply_);  // the reply was lost: say it again, do nothing twice
      return;
    }
    if (header.sequence() == working_on_ && working_on_ != 0) return;  // a retry of what is being done
    if (header.sequence() <= std::max(last_reply_.header().sequence(), working_on_)) {
      refuse(incoming.client, header, v1::Error::OUT_OF_ORDER,
             fmt::format("request {} is older than request {}", header.sequence(),
                         last_reply_.header().sequence()));
      return;
    }
    if (working_on_ != 0 && !request.has_stop()) {
      refuse(
          incoming.client, header, v1::Error::OUT_OF_ORDER,
          fmt::format("request {} came while request {} is being worked on", header.sequence(), working_on_));
      return;
    }
    if (request.has_stop()) {
      stop_sequence_ = header.sequence();
      if (working_on_ != 0) board_.request_stop();
    }
    working_on_ = header.sequence();
    working_header_ = header;
    mailbox_.put_request(std::move(request));
  }

  bool send_reply(v1::Reply reply) {
    if (reply.header().sequence() == working_on_) working_on_ = 0;
    stop_answered_ = stop_sequence_ != 0 && reply.header().sequence() == stop_sequence_;
    last_reply_ = std::move(reply);
    if (channel_.send(owner_, last_reply_)) return true;
    spdlog::error("the coupler of run {} is gone", run_id_);
    return false;
  }

  bool report_progress() {
    const auto now = steady_clock::now();
    if (owner_.empty() || now - last_progress_ < progress_interval) return true;
    last_progress_ = now;
    v1::Reply reply;
    if (working_on_ != 0) *reply.mutable_header() = working_header_;
    reply.mutable_header()->set_protocol_version(protocol_version);
    reply.mutable_header()->set_run_id(run_id_);
    const auto snapshot = board_.snapshot();
    auto* progress = reply.mutable_progress();
    progress->set_phase(snapshot.phase);
    progress->set_fraction(snapshot.fraction);
    progress->set_counter(snapshot.counter);
    progress->set_note(snapshot.note);
    if (channel_.send(owner_, reply)) return true;
    spdlog::error("the coupler of run {} is gone", run_id_);
    return false;
  }

  ServerChannel& channel_;
  Mailbox& mailbox_;
  ProgressBoard& board_;
  const Identity& identity_;
  double orphan_timeout_;
  steady_clock::time_point born_;
  steady_clock::time_point last_progress_;
  std::string run_id_;
  std::string owner_;
  v1::Reply last_reply_;
  v1::Header working_header_;
  std::uint64_t working_on_ = 0;
  std::uint64_t stop_sequence_ = 0;
  bool stop_answered_ = false;
};

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
  bool check = false;
  bool insecure = false;
  app.add_option("--bind", endpoint, "Address to serve at, ipc:///path or tcp://host:port");
  app.add_option("--folder", folder, "Folder for the files it writes")->capture_default_str();
  app.add_option("--threads", threads, "Threads to compute with; all cores when not given");
  app.add_option("--orphan-timeout", orphan_timeout, "End after so many seconds without a coupler; 0: never");
  app.add_flag("--check", check, "Check the scene on standard input (a Configure message) and end");
  app.add_flag("--insecure", insecure, "Allow an address that other machines reach, without authentication");
  app.set_version_flag("--version", identity.version);
  try {
    app.parse(argc, argv);
    if (!check && endpoint.empty()) throw CLI::RequiredError("--bind");
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
    ServerChannel channel(endpoint, insecure);
    if (!is_local(endpoint)) spdlog::warn("INSECURE: {} takes requests from anyone who reaches it", endpoint);
    spdlog::info("{} {} at {}, {} threads", identity.name, identity.version, channel.bound_endpoint(),
                 omp_get_max_threads());
    ProgressBoard board;
    Mailbox mailbox;
    Reception reception(channel, mailbox, board, identity, orphan_timeout);
    std::atomic<bool> computing_ended{false};
    bool stopped_properly = false;
    std::thread receiver([&] {
      try {
        stopped_properly = reception.run();
      } catch (const std::exception& error) {
        spdlog::error("channel: {}", error.what());
      }
      if (stopped_properly) return;
      board.request_stop();
      mailbox.close();
      const auto deadline = steady_clock::now() + grace_after_loss;
      while (!computing_ended && steady_clock::now() < deadline) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      if (!computing_ended) {
        spdlog::error("computing does not stop; ending all the same");
        std::_Exit(1);
      }
    });

    Session session(*participant, folder, board);
    while (auto request = mailbox.take_request()) {
      board.begin_phase(phase_name(*request));
      v1::Reply reply = session.answer(*request);
      board.begin_phase("idle");
      if (reply.has_error()) {
        spdlog::error("{}, window {} iteration {}: {} {}", phase_name(*request), request->header().window(),
                      request->header().iteration(), reply.error().field(), reply.error().message());
      }
      mailbox.put_reply(std::move(reply));
      channel.wake();
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
