#include "pipeline/stage/guarded_main.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <optional>
#include <string_view>
#include <system_error>

#include "io/base/error.h"
#include "io/base/quoting.h"
#include "io/process/interrupt.h"

namespace pipeline {

using io::Error;
using io::ExitCode;

namespace {

thread_local bool memory_was_refused = false;  // to this thread

[[noreturn]] void NoteRefusal() {
  memory_was_refused = true;
  throw std::bad_alloc();
}

// Whether it is for lack of memory that the process must end.
bool MemoryIsLacking() {
  try {
    if (std::current_exception()) throw;
  } catch (const std::bad_alloc&) {
    return true;
  } catch (...) {
    return false;
  }
  // A noexcept function that GCC before 14 compiled, as those of libstdc++ that walk folders, ends the
  // process before it names the exception.
  return memory_was_refused && std::uncaught_exceptions() > 0;
}

// Where a destructor finds no memory there is nobody to catch it: the process ends as a killed one would, but
// with the code that says why.
[[noreturn]] void EndAtOnce() {
  if (MemoryIsLacking()) {
    constexpr std::string_view kWords =
        "error E6: out of memory. Use smaller pictures or fewer of them, or a larger --memory\n";
    [[maybe_unused]] const ssize_t n = write(STDERR_FILENO, kWords.data(), kWords.size());
    _exit(static_cast<int>(ExitCode::kNoResources));
  }
  std::abort();
}

// A closed standard stream would lend its number to the next file, which would then get what is printed.
void KeepStandardStreams() {
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(fd, F_GETFD) == -1) open("/dev/null", O_RDWR);  // takes the lowest free number: this one
  }
}

}  // namespace

int GuardedMain(const std::string& program, const std::function<void()>& body) {
  const auto report = [&](ExitCode code, const std::string& what) {
    std::fprintf(
        stderr, "%s: error E%d: %s\n", program.c_str(), static_cast<int>(code), io::Printable(what).c_str());
    return static_cast<int>(code);
  };
  try {
    KeepStandardStreams();
    std::set_new_handler(NoteRefusal);
    std::set_terminate(EndAtOnce);
    io::InstallInterruptHandlers();
    body();
    return static_cast<int>(ExitCode::kOk);
  } catch (const io::Interrupted& interrupted) {
    if (const std::optional<Error> reason = io::StopReason()) return report(reason->code(), reason->what());
    std::fprintf(stderr,
                 "%s: stopped by signal %d; the same command continues\n",
                 program.c_str(),
                 interrupted.signal());
    return 128 + interrupted.signal();
  } catch (const Error& error) {
    return report(error.code(), error.what());
  } catch (const std::bad_alloc&) {
    return report(ExitCode::kNoResources,
                  "out of memory. Use smaller pictures or fewer of them, or a larger --memory");
  } catch (const std::filesystem::filesystem_error& error) {
    return report(ExitCode::kNoResources, error.what());
  } catch (const std::system_error& error) {  // of threads
    return report(ExitCode::kNoResources, std::string(error.what()) + ". Use fewer --threads");
  } catch (const std::exception& error) {
    return report(ExitCode::kInternal, std::string(error.what()) + ". Please report this as a bug");
  }
}

}  // namespace pipeline
