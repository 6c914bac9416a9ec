#include "pipeline/stage/guarded_main.h"

#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>

#include "io/base/error.h"
#include "io/base/interrupt.h"
#include "io/base/quoting.h"

namespace pipeline {

using io::Error;
using io::ExitCode;

int GuardedMain(const std::string& program, const std::function<void()>& body) {
  const auto report = [&](ExitCode code, const std::string& what) {
    std::fprintf(
        stderr, "%s: error E%d: %s\n", program.c_str(), static_cast<int>(code), io::Printable(what).c_str());
    return static_cast<int>(code);
  };
  try {
    io::InstallInterruptHandlers();
    body();
    return static_cast<int>(ExitCode::kOk);
  } catch (const io::Interrupted& interrupted) {
    std::fprintf(stderr,
                 "%s: stopped by signal %d; the same command continues\n",
                 program.c_str(),
                 interrupted.signal());
    return 128 + interrupted.signal();
  } catch (const Error& error) {
    return report(error.code(), error.what());
  } catch (const std::bad_alloc&) {
    return report(ExitCode::kNoResources, "out of memory. Use smaller pictures or fewer of them");
  } catch (const std::filesystem::filesystem_error& error) {
    return report(ExitCode::kNoResources, error.what());
  } catch (const std::exception& error) {
    return report(ExitCode::kInternal, std::string(error.what()) + ". Please report this as a bug");
  }
}

}  // namespace pipeline
