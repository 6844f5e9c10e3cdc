// Runs a Participant as a process of its own: command line, channel, threads, checks, progress.
//
//   PROGRAM --bind ipc:///path --folder DIR [--threads N]   serves one run, then ends
//   PROGRAM --check                                         reads a Configure message from standard input and
//                                                           writes the Configured answer to standard output
//
// Two threads: the main one computes, the other owns the socket. So a participant answers Hello, repeats a
// lost reply and reports progress while it computes, and ends by itself when the coupler is gone.
#pragma once

#include <memory>

#include "participant.hpp"

namespace estuary {

/// Exit status: 0 after Stop, 1 when the coupler vanished or the process failed, 2 for a wrong command line.
int serve(int argc, char** argv, std::unique_ptr<Participant> participant);

}  // namespace estuary
