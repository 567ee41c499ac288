#include "exactarm/base/interrupt.hpp"

#include <chrono>

namespace exactarm {
namespace {

using Clock = std::chrono::steady_clock;
// A person does not notice it, and asking costs some 100 ns.
constexpr auto kPause = std::chrono::milliseconds(20);

std::atomic<InterruptCheck> interrupt_check{nullptr};
thread_local const std::atomic<bool>* work_failed = nullptr;
thread_local Clock::time_point next_check{};

}  // namespace

void set_interrupt_check(InterruptCheck check) { interrupt_check = check; }

void check_interrupt() {
  if (work_failed) {
    if (work_failed->load(std::memory_order_relaxed)) throw Cancelled{};
    return;
  }
  const InterruptCheck check = interrupt_check.load(std::memory_order_relaxed);
  if (!check) return;
  const Clock::time_point now = Clock::now();
  if (now < next_check) return;
  next_check = now + kPause;
  check();
}

WorkerScope::WorkerScope(const std::atomic<bool>& failed) { work_failed = &failed; }
WorkerScope::~WorkerScope() { work_failed = nullptr; }

}  // namespace exactarm
