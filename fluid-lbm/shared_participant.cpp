#include "shared_participant.hpp"

#include <fmt/format.h>

#include <exception>
#include <memory>

namespace estuary::fluid {
namespace {

enum class Call : std::uint64_t { configure, start, advance, accept, save, load, frame, stop };

void send_call(Ranks& ranks, Call call) {
  (void)as_first_rank(&ranks, call);
}

std::string tell(Ranks& ranks, std::string text) {
  text.resize(as_first_rank(&ranks, text.size()));
  if (!text.empty()) ranks.broadcast(0, std::as_writable_bytes(std::span(text)));
  return text;
}

void wait_for_all(Ranks& ranks) {
  (void)ranks.any(false);
}

// What went wrong, when it did so on one rank only; nothing when all ranks have seen the same.
template <class Carry>
void carry_out(const Carry& carry, const EndAll& end_all, bool rethrow) {
  try {
    carry();
    return;
  } catch (const Diverged&) {
    if (rethrow) throw;
  } catch (const NotConverged&) {
    if (rethrow) throw;
  } catch (const BadInput&) {
    if (rethrow) throw;
  } catch (const Interrupted&) {
    if (rethrow) throw;
  } catch (const std::invalid_argument&) {
    if (rethrow) throw;
  } catch (const std::bad_alloc&) {
    end_all("out of memory");
  } catch (const std::exception& error) {
    end_all(error.what());
  }
}

}  // namespace

SharedParticipant::SharedParticipant(std::unique_ptr<Participant> own, Ranks& ranks, EndAll end_all,
                                     const std::optional<std::filesystem::path>& files_below)
    : own_(std::move(own)),
      ranks_(ranks),
      end_all_(std::move(end_all)),
      files_below_(files_below ? files_below->string() : std::string{}) {}

SharedParticipant::~SharedParticipant() {
  if (!stopped_) send_call(ranks_, Call::stop);
}

// The others hear of a scene that the first rank has found nothing wrong with. They find nothing either, or
// all end: a file that is on the first rank's machine alone, for one.
Plan SharedParticipant::configure(Scene& scene, const std::string& role) {
  Plan plan = own_->configure(scene, role);
  if (!scene.problems().empty()) return plan;
  send_call(ranks_, Call::configure);
  tell(ranks_, scene.as_run());
  tell(ranks_, role);
  tell(ranks_, files_below_);
  wait_for_all(ranks_);
  return plan;
}

v1::Exchange SharedParticipant::start(const v1::Exchange& initial, const std::filesystem::path& folder) {
  send_call(ranks_, Call::start);
  tell(ranks_, initial.SerializeAsString());
  v1::Exchange result;
  std::exception_ptr lacking;
  carry_out(
      [&] {
        try {
          result = own_->start(initial, folder);
        } catch (const LackOfMemory&) {
          lacking = std::current_exception();
        }
      },
      end_all_, true);
  if (lacking) std::rethrow_exception(lacking);
  return result;
}

AdvanceResult SharedParticipant::advance(const Window& window, const v1::Exchange& inputs,
                                         ProgressBoard& progress) {
  send_call(ranks_, Call::advance);
  (void)as_first_rank(&ranks_, window);
  tell(ranks_, inputs.SerializeAsString());
  AdvanceResult result;
  carry_out([&] { result = own_->advance(window, inputs, progress); }, end_all_, true);
  return result;
}

void SharedParticipant::accept() {
  send_call(ranks_, Call::accept);
  carry_out([&] { own_->accept(); }, end_all_, true);
}

// Files are the first rank's, after all have given it what belongs there: an error of it is not theirs. But
// memory may end before that, where the whole lattice comes together, and the others then wait for ever.
template <class Carry>
void SharedParticipant::with_files(const Carry& carry) {
  try {
    carry();
  } catch (const std::bad_alloc&) {
    end_all_("out of memory, where the first rank holds the whole lattice for a file");
  }
}

void SharedParticipant::save(const std::filesystem::path& file) {
  send_call(ranks_, Call::save);
  with_files([&] { own_->save(file); });
}

void SharedParticipant::load(const std::filesystem::path& file) {
  send_call(ranks_, Call::load);
  with_files([&] { own_->load(file); });
}

std::vector<std::string> SharedParticipant::frame(std::uint64_t number, double time) {
  send_call(ranks_, Call::frame);
  std::vector<std::string> files;
  with_files([&] { files = own_->frame(number, time); });
  return files;
}

void SharedParticipant::stop() {
  own_->stop();
  send_call(ranks_, Call::stop);
  stopped_ = true;
}

void follow_first_rank(Participant& participant, Ranks& ranks, const EndAll& end_all) {
  ProgressBoard board;
  participant.report_to(board);
  std::optional<Scene> scene;  // expressions of the participant may look into it
  for (Call call = Call::accept; call != Call::stop;) {
    call = as_first_rank(&ranks, Call::stop);
    carry_out(
        [&] {
          switch (call) {
            case Call::configure: {
              const std::string text = tell(ranks, {});
              const std::string role = tell(ranks, {});
              const std::string files_below = tell(ranks, {});
              scene.emplace(Scene::parse(text, "scene"));
              if (!files_below.empty()) scene->confine_files(files_below);
              if (scene->problems().empty()) (void)participant.configure(*scene, role);
              if (!scene->problems().empty())
                end_all(fmt::format("finds a problem in the scene that the first rank does not: {}",
                                    scene->problems().front().message));
              wait_for_all(ranks);
              break;
            }
            case Call::start: {
              v1::Exchange initial;
              initial.ParseFromString(tell(ranks, {}));
              try {
                (void)participant.start(initial, ".");
              } catch (const LackOfMemory&) {
                // Known to all.
              }
              break;
            }
            case Call::advance: {
              const Window window = as_first_rank(&ranks, Window{});
              v1::Exchange inputs;
              inputs.ParseFromString(tell(ranks, {}));
              (void)participant.advance(window, inputs, board);
              break;
            }
            case Call::accept:
              participant.accept();
              break;
            case Call::save:
              participant.save({});
              break;
            case Call::load:
              try {
                participant.load({});
              } catch (const std::runtime_error&) {
                // The first rank's file; all have heard what is wrong with it.
              }
              break;
            case Call::frame:
              (void)participant.frame(0, 0.0);
              break;
            case Call::stop:
              break;
          }
        },
        end_all, false);
  }
}

}  // namespace estuary::fluid
