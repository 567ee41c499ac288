// A long loop asks now and then whether it shall end early: `check_interrupt()` throws then.
//
// Whoever calls the core from outside says once how to find out (Python: whether a signal has arrived). The
// thread that called into the core asks, at most every 20 ms; a worker of the thread pool ends when the work
// it belongs to has failed.
#pragma once

#include <atomic>

namespace exactarm {

using InterruptCheck = void (*)();  // throws to end the work
void set_interrupt_check(InterruptCheck check);

void check_interrupt();

// Thrown in a worker whose work has failed in another thread; never leaves the thread pool.
struct Cancelled {};

// While one exists, check_interrupt() in this thread looks at `failed` only.
class WorkerScope {
 public:
  explicit WorkerScope(const std::atomic<bool>& failed);
  ~WorkerScope();
  WorkerScope(const WorkerScope&) = delete;
  WorkerScope& operator=(const WorkerScope&) = delete;
};

}  // namespace exactarm
