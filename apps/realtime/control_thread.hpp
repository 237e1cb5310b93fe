// A thread of its own for paced runs: real-time priority, processors, locked memory, touched stack.
// Called by the main thread, which waits for it; start-up allocates and blocks, the body does what
// it does.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/realtime/runtime_settings.hpp"

namespace clamber {

/// Gives the calling thread what the settings ask for. All of it is tried.
/// @return what the system did not grant: a line each, with the way to put it right
[[nodiscard]] std::vector<std::string> enter_realtime(const RuntimeSettings& settings);

/// Runs `body` in a thread that called enter_realtime() and takes no signals, and passes on what
/// that returned. Threads that exist by then keep their own policy: whoever makes threads of
/// ordinary priority (DDS) does it before. Memory is unlocked again afterwards.
/// @throws what `body` throws; InputError when settings.required and something was not granted,
///   before `body`
void run_in_control_thread(const RuntimeSettings& settings,
                           const std::function<void(std::vector<std::string> refused)>& body);

}  // namespace clamber
