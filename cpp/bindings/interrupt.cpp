#include "exactarm/base/interrupt.hpp"

#include <atomic>
#include <chrono>
#include <thread>

#include "binding.hpp"
#include "exactarm/base/thread_pool.hpp"

namespace exactarm::bindings {
namespace {

// Set when the interpreter begins to end,
// before it turns threads away (then it unwinds them, through C++ frames as well).
std::atomic<bool> ending = false;
std::atomic<int> coming_back = 0;  // threads on their way into the interpreter
std::thread::id ending_thread;     // written before `ending`

bool must_stay_out() { return ending.load() && std::this_thread::get_id() != ending_thread; }

const std::thread::id main_thread = std::this_thread::get_id();  // that which loads the extension

// Runs the handlers of signals that have arrived;
// what they raise ends the work. Only Python's main thread has any.
void check_signals() {
  // Another thread that waits for an ending interpreter would be unwound through frames that cannot be.
  if (std::this_thread::get_id() != main_thread || must_stay_out()) return;
  const py::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

}  // namespace

// Asked after the count: either the end sees this thread and waits for it, or this thread sees the end.
ReleasedGil::~ReleasedGil() {
  ++coming_back;
  if (must_stay_out()) {
    --coming_back;
    while (true) std::this_thread::sleep_for(std::chrono::hours(1));
  }
  PyEval_RestoreThread(state_);
  --coming_back;
}

void bind_interrupt(py::module_&) {
  set_interrupt_check(&check_signals);
  // Threads end, or stay out, before the interpreter does.
  py::module_::import("atexit").attr("register")(py::cpp_function([] {
    ending_thread = std::this_thread::get_id();
    ending = true;
    const ReleasedGil released;
    while (coming_back.load() > 0) std::this_thread::yield();
    ThreadPool::shared().stop();
  }));
}

}  // namespace exactarm::bindings
