#include "conform.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "conform_inputs.hpp"
#include "dialogue.hpp"
#include "participants.hpp"
#include "requirements.hpp"
#include "wet_motion.hpp"
#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

constexpr double reports_at_least_every = 0.5;  // [s], of the contract
constexpr double counts_as_lost = 1.5;  // [s] of silence; what is between the two a busy machine may cause
constexpr double ends_within = 5.0;     // [s] after Stop

std::string bits(const v1::Advanced& answer) {
  std::string text = answer.outputs().SerializeAsString();
  for (const auto& watch : answer.watches()) text += watch.SerializeAsString();
  return text;
}

// Relative L2 difference of what two answers say about the wet surface or the grains.
double difference(const v1::Advanced& a, const v1::Advanced& b) {
  const auto of = [](const auto& first, const auto& second) {
    if (first.size() != second.size()) return 1.0;
    double change = 0, size = 0;
    for (int i = 0; i < first.size(); ++i) {
      change += (first[i] - second[i]) * (first[i] - second[i]);
      size += first[i] * first[i];
    }
    return size > 0 ? std::sqrt(change / size) : std::sqrt(change);
  };
  const auto &x = a.outputs(), &y = b.outputs();
  return std::max({of(x.displacements().displacement(), y.displacements().displacement()),
                   of(x.pressures().pressure(), y.pressures().pressure()),
                   of(x.forces().force(), y.forces().force()),
                   of(x.grain_states().centre(), y.grain_states().centre()),
                   of(x.grain_forces().force(), y.grain_forces().force())});
}

class Examiner {
public:
  Examiner(const CheckedScene* scene, const ConformTarget& target, Dialogue& dialogue, v1::Exchange initial,
           Examination& result)
      : scene_(scene), target_(target), dialogue_(dialogue), initial_(std::move(initial)), result_(result) {}

  void run() {
    greet();
    if (scene_ == nullptr) return;
    headers();
    configure();
    if (!start()) return;
    if (first_window() && later_windows()) frame();
    liveness();
    end();
  }

private:
  void note(std::string what, bool holds, std::string detail = {}) {
    result_.findings.push_back({std::move(what), holds ? Conforms::yes : Conforms::no, std::move(detail)});
  }
  void leave_out(std::string what, Conforms how, std::string why) {
    result_.findings.push_back({std::move(what), how, std::move(why)});
  }

  static std::string said(const v1::Reply& reply) {
    if (!reply.has_error()) return "did it";
    return fmt::format("{} {}", v1::Error::Kind_Name(reply.error().kind()),
                       reply.error().field().empty()
                           ? reply.error().message()
                           : reply.error().field() + ": " + reply.error().message());
  }
  void expect_error(const std::string& what, const v1::Reply& reply, v1::Error::Kind kind) {
    const bool right = reply.has_error() && reply.error().kind() == kind;
    note(what, right,
         right ? std::string()
               : fmt::format("expected the error {}, it {}{}", v1::Error::Kind_Name(kind),
                             reply.has_error() ? "said " : "", said(reply)));
  }
  // Several requests that all have to be refused, as one line of the table.
  void expect_errors(const std::string& what, const std::vector<WrongExchange>& wrong, const auto& ask) {
    if (wrong.empty()) return;
    std::string faults;
    for (const WrongExchange& one : wrong) {
      const v1::Reply reply = ask(one.exchange);
      if (reply.has_error() && reply.error().kind() == v1::Error::BAD_MESSAGE) continue;
      faults += fmt::format("{}{}: it {}{}", faults.empty() ? "" : "; ", one.what,
                            reply.has_error() ? "said " : "", said(reply));
    }
    note(what, faults.empty(), faults.empty() ? fmt::format("{} of them", wrong.size()) : faults);
  }

  [[nodiscard]] bool steady() const { return scene_->coupling.mode == CouplingMode::steady; }

  v1::Request advance(const v1::Exchange& inputs, double begin, double duration) const {
    v1::Request request;
    auto* advance = request.mutable_advance();
    advance->set_mode(steady() ? v1::Advance::STEADY : v1::Advance::TRANSIENT);
    advance->set_time(steady() ? 0.0 : begin);
    advance->set_duration(steady() ? 0.0 : duration);
    *advance->mutable_inputs() = inputs;
    return request;
  }
  v1::Request advance(const v1::Exchange& inputs, int window) const {
    const double length = scene_->coupling.window;
    return advance(inputs, (window - 1) * length, length);
  }

  void greet() {
    v1::Request hello;
    hello.mutable_hello();
    const v1::Reply reply = dialogue_.ask(hello);
    welcome_ = reply.welcome();
    result_.participant =
        fmt::format("{} {}, process {}", welcome_.name(), welcome_.version(), welcome_.process());
    note("answers Hello", reply.has_welcome() && !welcome_.name().empty(),
         reply.has_welcome() ? fmt::format("roles {}; can {}", fmt::join(welcome_.roles(), ", "),
                                           fmt::join(welcome_.capabilities(), ", "))
                             : said(reply));
    note("is free", welcome_.run_id().empty(),
         welcome_.run_id().empty() ? "" : fmt::format("serves run {}", welcome_.run_id()));
    dialogue_.send_bytes("\xff\xff these are not the bytes of a request");
    note("outlives bytes that are no message", dialogue_.ask(hello).has_welcome());
    hello.clear_header();
    *hello.mutable_header() = dialogue_.next_header();
    hello.mutable_header()->set_protocol_version(protocol_version + 1);
    expect_error("refuses another protocol version", dialogue_.ask_as_it_is(hello), v1::Error::VERSION);
    if (scene_ == nullptr) return;
    try {
      require(scene_->coupling, target_.role, welcome_, "its address");
      note("can do what the scene needs", true);
    } catch (const RunFailure& failure) {
      note("can do what the scene needs", false, failure.what());
    }
  }

  void headers() {
    v1::Request request;
    request.mutable_accept();
    *request.mutable_header() = dialogue_.next_header();
    request.mutable_header()->clear_run_id();
    expect_error("refuses a request of no run", dialogue_.ask_as_it_is(request), v1::Error::BAD_MESSAGE);
    expect_error("refuses Accept before Start", dialogue_.ask(request), v1::Error::OUT_OF_ORDER);
    request.clear_header();
    *request.mutable_header() = dialogue_.next_header();
    request.mutable_header()->set_run_id("another");
    expect_error("refuses another run while it serves one", dialogue_.ask_as_it_is(request), v1::Error::BUSY);
  }

  void configure() {
    v1::Request request;
    auto& message = *request.mutable_configure() = configure_message(scene_->given, target_.role);
    message.set_scene("title = \n[" + target_.role + "]\n");
    const v1::Reply unreadable = dialogue_.ask(request);
    note("reports a scene that is not TOML", unreadable.configured().problems_size() > 0,
         unreadable.has_configured() ? "" : said(unreadable));
    message = configure_message(scene_->given, target_.role);
    message.add_overrides(target_.role + ".no_such_key_as_this=1");
    const v1::Reply unknown = dialogue_.ask(request);
    note("refuses an unknown key in its table", unknown.configured().problems_size() > 0,
         unknown.has_configured() ? "" : said(unknown));
    message = configure_message(scene_->given, target_.role);
    const v1::Reply reply = dialogue_.ask(request);
    std::string problems = reply.has_configured() ? "" : said(reply);
    for (const auto& problem : reply.configured().problems())
      problems += fmt::format("{}{}:{}: {}", problems.empty() ? "" : "; ", problem.line(), problem.column(),
                              problem.message());
    note("accepts the scene", problems.empty(), problems);
  }

  bool start() {
    const auto ask = [&](const v1::Exchange& exchange) {
      v1::Request request;
      *request.mutable_start()->mutable_initial() = exchange;
      return dialogue_.ask(request);
    };
    expect_errors("refuses a wrong wet surface and stays up", wrong_surfaces(initial_), ask);
    const v1::Reply reply = ask(initial_);
    note("starts", reply.has_started(), reply.has_started() ? "" : said(reply));
    if (!reply.has_started()) return false;
    started_ = reply.started();
    inputs_.emplace(scene_->coupling, target_.role, initial_, started_.initial(), target_.pressure);
    if (target_.role == "solid" && scene_->coupling.participants.size() > 1) {
      std::string fault;
      try {
        check_wet_surface(started_.initial().wet_surface());
        check_displacements(started_.initial().displacements(), started_.initial().wet_surface());
      } catch (const std::invalid_argument& error) {
        fault = error.what();
      }
      note("brings a valid wet surface", fault.empty(),
           fault.empty() ? fmt::format("{} nodes", node_count(started_.initial().wet_surface())) : fault);
    }
    expect_error("refuses a second Start", ask(initial_), v1::Error::OUT_OF_ORDER);
    return true;
  }

  // One window, repeated in every way.
  bool first_window() {
    dialogue_.at(1, 1);
    expect_errors("refuses wrong inputs and stays up",
                  inputs_->any() ? wrong_fields(inputs_->inputs(1)) : std::vector<WrongExchange>{},
                  [&](const v1::Exchange& exchange) { return dialogue_.ask(advance(exchange, 1)); });
    v1::Request accept;
    accept.mutable_accept();
    expect_error("refuses Accept before an Advance", dialogue_.ask(accept), v1::Error::OUT_OF_ORDER);

    const v1::Reply first = dialogue_.ask(advance(inputs_->inputs(1), 1));
    if (!computed(first)) return false;
    repeated_requests(first);
    rewind(first.advanced());
    accept_window("accepts a window", true);
    expect_error("refuses to accept it twice", dialogue_.ask(accept), v1::Error::OUT_OF_ORDER);
    return true;
  }

  bool computed(const v1::Reply& reply) {
    const std::string fault =
        reply.has_advanced() ? inputs_->fault_of(reply.advanced().outputs()) : said(reply);
    note("computes", fault.empty(),
         fault.empty()
             ? fmt::format("{:.3g} s of it {:.3g} s computing", dialogue_.longest_answer(), reply.compute_s())
             : fault);
    const auto& header = reply.header();
    note("repeats the request's header",
         header.window() == 1 && header.iteration() == 1 && header.protocol_version() == protocol_version);
    return reply.has_advanced();
  }

  void repeated_requests(const v1::Reply& first) {
    v1::Request again = advance(inputs_->inputs(1), 1);
    *again.mutable_header() = first.header();
    const v1::Reply same = dialogue_.ask_as_it_is(again);
    note("answers a repeated request with the same reply",
         same.SerializeAsString() == first.SerializeAsString(), "of the same bytes, computing nothing twice");
    again.mutable_header()->set_sequence(first.header().sequence() - 1);
    expect_error("refuses a stale request", dialogue_.ask_as_it_is(again), v1::Error::OUT_OF_ORDER);
  }

  void rewind(const v1::Advanced& first) {
    const bool repeats =
        steady() || (scene_->coupling.implicit() && scene_->coupling.participants.size() > 1 &&
                     scene_->coupling.find("solid") != nullptr);
    const std::string what = steady() ? "comes to the same equilibrium again" : "rewinds to the same bits";
    if (!repeats) return leave_out(what, Conforms::not_asked, "this scene repeats no window");
    if (!steady() && !can(welcome_, "rewind"))
      return leave_out(what, Conforms::unsupported, "only explicit schemes can use it");
    std::uint64_t iteration = 1;
    const auto with = [&](int variant) {
      dialogue_.at(1, ++iteration);
      return dialogue_.ask(advance(inputs_->inputs(variant), 1));
    };
    std::string fault;
    double largest = 0;
    const auto compare = [&](const v1::Reply& reply, const char* after) {
      if (!reply.has_advanced()) {
        fault = said(reply);
        return;
      }
      const double change = difference(first, reply.advanced());
      largest = std::max(largest, change);
      const bool same = steady() ? change <= 10 * scene_->coupling.measures.front().limit
                                 : bits(reply.advanced()) == bits(first);
      if (!same && fault.empty()) fault = fmt::format("differs by {:.2e} after {}", change, after);
    };
    compare(with(1), "the same inputs");
    const v1::Reply other = with(2);
    if (!other.has_advanced()) fault = said(other);
    compare(with(1), "other inputs");
    const v1::Reply zero = with(0);
    const std::string at_zero =
        zero.has_advanced() ? inputs_->fault_of(zero.advanced().outputs()) : said(zero);
    compare(with(1), "zero inputs");
    if (inputs_->any()) {
      const auto wrong = wrong_fields(inputs_->inputs(2));
      (void)dialogue_.ask(advance(wrong.front().exchange, 1));
      compare(with(1), "inputs that were refused");
    }
    note(what, fault.empty(),
         !fault.empty() ? fault
         : steady()     ? fmt::format("within {:.1e}", largest)
                        : "four times");
    if (inputs_->any()) note("computes with inputs of zero", at_zero.empty(), at_zero);
  }

  bool accept_window(const char* what, bool always) {
    v1::Request accept;
    accept.mutable_accept();
    const v1::Reply reply = dialogue_.ask(accept);
    if (always || !reply.has_done()) note(what, reply.has_done(), reply.has_done() ? "" : said(reply));
    return reply.has_done();
  }

  bool later_windows() {
    dialogue_.at(2, 1);
    const bool checkpoints = can(welcome_, "checkpoint");
    const std::string what = "goes on from a checkpoint with the same bits";
    v1::Request save, load;
    save.mutable_save()->set_file("conform.checkpoint");
    load.mutable_load()->set_file("conform.checkpoint");
    v1::Reply saved;
    if (checkpoints) saved = dialogue_.ask(save);
    const v1::Reply next = dialogue_.ask(advance(inputs_->inputs(2), 2));
    const std::string fault = next.has_advanced() ? inputs_->fault_of(next.advanced().outputs()) : said(next);
    note("computes the next window", fault.empty(), fault);
    if (!next.has_advanced()) return false;
    if (!checkpoints) {
      leave_out(what, Conforms::unsupported, "a stopped run cannot be resumed with it");
    } else if (!saved.has_done()) {
      note(what, false, said(saved));
    } else {
      accept_window("accepts the next window", false);
      const v1::Reply loaded = dialogue_.ask(load);
      const v1::Reply again = dialogue_.ask(advance(inputs_->inputs(2), 2));
      if (!loaded.has_done() || !again.has_advanced()) {
        note(what, false, said(loaded.has_done() ? again : loaded));
      } else {
        const double change = difference(next.advanced(), again.advanced());
        const bool same = steady() ? change <= 10 * scene_->coupling.measures.front().limit
                                   : bits(again.advanced()) == bits(next.advanced());
        note(what, same, same && !steady() ? "" : fmt::format("differs by {:.1e}", change));
      }
      save.mutable_save()->set_file("../outside");
      note("saves only inside its folder", dialogue_.ask(save).has_error());
      load.mutable_load()->set_file("never-written");
      note("refuses a checkpoint that is not there", dialogue_.ask(load).has_error());
    }
    accept_window("accepts the next window", false);
    other_length();
    return true;
  }

  void other_length() {
    const std::string what = "computes a shorter window";
    if (steady()) return;
    if (!started_.has_window_step())
      return leave_out(what, Conforms::unsupported, "windows of the scene's length only");
    dialogue_.at(3, 1);
    const double length = scene_->coupling.window, step = started_.window_step();
    const double half =
        step > 0 ? std::max(1.0, std::floor(0.5 * length / step + 1e-9)) * step : 0.5 * length;
    const v1::Reply reply = dialogue_.ask(advance(inputs_->inputs(1), 2 * length, half));
    const std::string fault =
        reply.has_advanced() ? inputs_->fault_of(reply.advanced().outputs()) : said(reply);
    note(what, fault.empty(), fault.empty() ? fmt::format("of {:g} s", half) : fault);
    if (reply.has_advanced()) accept_window("accepts the shorter window", false);
  }

  void frame() {
    v1::Request request;
    request.mutable_frame()->set_number(0);
    const v1::Reply reply = dialogue_.ask(request);
    std::string missing = reply.has_done() ? "" : said(reply);
    if (dialogue_.launched()) {
      for (const auto& file : reply.done().files())
        if (!std::filesystem::exists(target_.folder / target_.role / file)) missing = file + " is not there";
    }
    note("writes a frame", missing.empty(),
         missing.empty() ? fmt::format("{} files", reply.done().files_size()) : missing);
  }

  void liveness() {
    const int reports = dialogue_.listen(1.2);
    note("reports progress while it waits", reports >= 2, fmt::format("{} reports in 1.2 s", reports));
    const double silence = dialogue_.longest_silence(), longest = dialogue_.longest_answer();
    if (longest < reports_at_least_every)
      return leave_out("reports progress while it computes", Conforms::not_asked,
                       fmt::format("nothing took longer than {:.2g} s", longest));
    note("reports progress while it computes", silence < counts_as_lost,
         fmt::format("longest silence {:.2f} s, longest answer {:.2f} s", silence, longest));
  }

  // Told to stop in the middle of a window.
  void end() {
    dialogue_.at(4, 1);
    dialogue_.tell(advance(inputs_->inputs(1), 3 * scene_->coupling.window, scene_->coupling.window));
    v1::Request stop;
    stop.mutable_stop();
    const v1::Reply reply = dialogue_.ask(stop);
    note("stops while it computes", reply.has_done(), reply.has_done() ? "" : said(reply));
    if (const auto ended = dialogue_.ends_within(ends_within))
      note("ends after Stop", *ended, *ended ? "" : fmt::format("still there after {:g} s", ends_within));
  }

  const CheckedScene* scene_;
  const ConformTarget& target_;
  Dialogue& dialogue_;
  v1::Exchange initial_;
  Examination& result_;
  v1::Welcome welcome_;
  v1::Started started_;
  std::optional<ConformInputs> inputs_;
};

}  // namespace

Examination examine(const CheckedScene* scene, const ConformTarget& target,
                    const std::atomic<int>& interrupt) {
  Examination result;
  v1::Exchange initial;
  if (scene != nullptr) initial = what_others_bring(*scene, target.role, target.folder / "others", interrupt);
  std::unique_ptr<ChildProcess> child;
  std::string endpoint = target.endpoint;
  if (scene != nullptr && !target.command.empty()) {
    endpoint = "ipc://" + (target.folder / "socket").string();
    const ParticipantScene participant{
        .role = target.role, .command = target.command, .endpoint = {}, .threads = 1};
    child = std::make_unique<ChildProcess>(
        launch_command(scene->coupling, participant, endpoint, target.folder), target.folder / "log.txt");
  }
  Dialogue dialogue(endpoint, std::move(child), target.timeout, interrupt);
  try {
    Examiner(scene, target, dialogue, std::move(initial), result).run();
  } catch (const NoAnswer& lost) {
    result.lost = true;
    result.findings.push_back({"goes on answering", Conforms::no, lost.what()});
  }
  return result;
}

std::string text_of(const Examination& examination) {
  std::string text = examination.participant + "\n";
  std::size_t width = 0, held = 0, failed = 0;
  for (const Finding& finding : examination.findings) width = std::max(width, finding.what.size());
  for (const Finding& finding : examination.findings) {
    const char* verdict = "ok";
    if (finding.conforms == Conforms::no) verdict = "FAILS";
    if (finding.conforms == Conforms::unsupported) verdict = "cannot";
    if (finding.conforms == Conforms::not_asked) verdict = "-";
    held += finding.conforms == Conforms::yes ? 1 : 0;
    failed += finding.conforms == Conforms::no ? 1 : 0;
    text += fmt::format("  {:<{}}  {:<6}  {}", finding.what, width, verdict, finding.detail);
    text.erase(text.find_last_not_of(' ') + 1);
    text += "\n";
  }
  return text + fmt::format("{} hold, {} fail, {} not supported or not asked\n", held, failed,
                            examination.findings.size() - held - failed);
}

ExitStatus status_of(const Examination& examination) {
  if (examination.lost) return ExitStatus::participant_lost;
  const bool failed = std::any_of(examination.findings.begin(), examination.findings.end(),
                                  [](const Finding& finding) { return finding.conforms == Conforms::no; });
  return failed ? ExitStatus::check_failed : ExitStatus::done;
}

}  // namespace estuary::coupler
