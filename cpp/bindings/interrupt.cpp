#include "exactarm/base/interrupt.hpp"

#include <chrono>
#include <thread>

#include "binding.hpp"
#include "exactarm/base/thread_pool.hpp"

namespace exactarm::bindings {
namespace {

bool interpreter_ends() {
#if PY_VERSION_HEX >= 0x030D0000
  return Py_IsFinalizing() != 0;
#else
  return _Py_IsFinalizing() != 0;
#endif
}

const std::thread::id main_thread = std::this_thread::get_id();  // that which loads the extension

// Runs the handlers of signals that have arrived; what they raise ends the work. Only Python's main thread has any.
void check_signals() {
  // Another thread that waits for an ending interpreter would be unwound through frames that cannot be.
  if (std::this_thread::get_id() != main_thread || interpreter_ends()) return;
  const py::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

}  // namespace

ReleasedGil::~ReleasedGil() {
  while (interpreter_ends()) std::this_thread::sleep_for(std::chrono::hours(1));
  PyEval_RestoreThread(state_);
}

void bind_interrupt(py::module_&) {
  set_interrupt_check(&check_signals);
  // Threads end before the interpreter does.
  py::module_::import("atexit").attr("register")(py::cpp_function([] {
    const ReleasedGil released;
    ThreadPool::shared().stop();
  }));
}

}  // namespace exactarm::bindings
