// The module `exactarm._core` where the core was compiled for several processors: it loads the widest one
// that this processor runs, and hands over to it. Each is a whole extension of its own, `_core.NAME.so`
// beside this one, so that no code of a wider one can be reached on a narrower processor.
// EXACTARM_CPU=NAME in the environment asks for one of them by name.
#include <Python.h>
#include <dlfcn.h>

#include <cstdlib>
#include <string>

#if !defined(__x86_64__)
#error "one build is enough for this processor: EXACTARM_CPU=native, or a name that -march knows"
#endif

namespace {

struct Build {
  const char* name;
  bool runs;
};

// The widest that runs, or the one that is asked for; empty with an exception set.
std::string choose() {
  __builtin_cpu_init();
  const Build builds[] = {{"x86-64-v4", __builtin_cpu_supports("x86-64-v4") != 0},
                          {"x86-64-v3", __builtin_cpu_supports("x86-64-v3") != 0},
                          {"x86-64", true}};
  const char* const asked = std::getenv("EXACTARM_CPU");
  const bool any = !asked || !*asked;
  for (const Build& build : builds) {
    if (any ? !build.runs : std::string(asked) != build.name) continue;
    if (build.runs) return build.name;
    PyErr_Format(PyExc_ImportError, "EXACTARM_CPU=%s: this processor cannot run it", asked);
    return "";
  }
  PyErr_Format(PyExc_ImportError, "EXACTARM_CPU=%s: expected x86-64, x86-64-v3 or x86-64-v4", asked);
  return "";
}

}  // namespace

PyMODINIT_FUNC PyInit__core() {
  const std::string name = choose();
  if (name.empty()) return nullptr;
  Dl_info here;
  if (dladdr(reinterpret_cast<void*>(&PyInit__core), &here) == 0) {
    PyErr_SetString(PyExc_ImportError, "the folder of exactarm._core was not found");
    return nullptr;
  }
  const std::string own = here.dli_fname;
  const std::string file = own.substr(0, own.rfind('/') + 1) + "_core." + name + ".so";
  void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const start = library ? dlsym(library, "PyInit__core") : nullptr;
  if (!start) {
    PyErr_Format(PyExc_ImportError, "%s", dlerror());
    return nullptr;
  }
  return reinterpret_cast<PyObject* (*)()>(start)();
}
