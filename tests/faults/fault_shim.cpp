// Preloaded into a program: counts its calls of one kind, and at the n-th lets the call fail, kills the
// process, or cuts its power. Counting begins with the first file that the program creates. The environment
// says which:
//   FAULT_CALL   create, write, sync, rename, fork, thread or malloc
//   FAULT_AT     n; 0: none, count only
//   FAULT_HOW    fail (full disk, or out of memory), kill (before the call), power
//   FAULT_COUNT  file that gets the number of calls when the program ends by itself
// A power cut leaves what was synced: files with later writes are empty, and, for even n, names whose folder
// was not synced since are as before. Programs that the process starts are spared.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
}

namespace {

struct Rename {
  std::string from, to, saved;  // saved: a second name of what `to` was; empty when it was nothing
  bool exchange = false;
};

// Leaked: the program's last calls come after destructors.
struct State {
  std::string call, how;
  long at = 0;
  std::mutex mutex;
  std::set<std::string> unsynced;
  std::vector<Rename> renames;
};
State* state = nullptr;
std::atomic<long> n_calls = 0;
std::atomic<bool> started = false;
thread_local bool inside = false;  // calls of the shim itself are not counted

template <typename Function>
Function* Next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

__attribute__((constructor)) void Begin() {
  inside = true;
  const char* call = getenv("FAULT_CALL");
  if (call != nullptr) {
    state = new State;
    state->call = call;
    state->how = getenv("FAULT_HOW") ? getenv("FAULT_HOW") : "fail";
    state->at = atol(getenv("FAULT_AT") ? getenv("FAULT_AT") : "0");
  }
  unsetenv("LD_PRELOAD");
  unsetenv("FAULT_CALL");
  inside = false;
}

__attribute__((destructor)) void End() {
  const char* path = getenv("FAULT_COUNT");
  if (state == nullptr || path == nullptr) return;
  inside = true;
  if (FILE* file = fopen(path, "w")) {
    fprintf(file, "%ld\n", n_calls.load());
    fclose(file);
  }
}

[[noreturn]] void CutPower() {
  const std::lock_guard lock(state->mutex);
  for (const std::string& path : state->unsynced) truncate(path.c_str(), 0);
  const auto undo = [](const Rename& done) {
    if (done.exchange) {
      renameat2(AT_FDCWD, done.from.c_str(), AT_FDCWD, done.to.c_str(), RENAME_EXCHANGE);
      return;
    }
    rename(done.to.c_str(), done.from.c_str());
    if (!done.saved.empty()) rename(done.saved.c_str(), done.to.c_str());
  };
  if (state->at % 2 == 0) {
    for (auto done = state->renames.rbegin(); done != state->renames.rend(); ++done) undo(*done);
  }
  for (const Rename& done : state->renames) {
    if (!done.saved.empty()) unlink(done.saved.c_str());
  }
  kill(getpid(), SIGKILL);
  for (;;) pause();
}

// Whether this call of a kind is the one that fails.
bool Fails(const char* call) {
  if (inside || state == nullptr || !started || state->call != call) return false;
  if (++n_calls != state->at) return false;
  inside = true;
  if (state->how == "kill") kill(getpid(), SIGKILL);
  if (state->how == "power") CutPower();
  inside = false;
  return true;
}

std::string PathOf(int fd) {
  char path[4096];
  const ssize_t n = readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), path, sizeof path);
  return n > 0 ? std::string(path, static_cast<size_t>(n)) : "";
}

std::string Absolute(const char* path) {
  if (*path == '/') return path;
  char folder[4096];
  return getcwd(folder, sizeof folder) ? std::string(folder) + "/" + path : path;
}

// Runs `body` on the state, whose own allocations and calls do not count.
template <typename Body>
void Track(const Body& body) {
  if (inside || state == nullptr || state->how != "power") return;
  inside = true;
  {
    const std::lock_guard lock(state->mutex);
    body();
  }
  inside = false;
}

bool Creates(int flags) { return (flags & (O_CREAT | O_WRONLY | O_RDWR)) != 0; }

bool FailsToCreate() {
  started = started || !inside;
  return Fails("create");
}

int Refuse(int error) {
  errno = error;
  return -1;
}

void NoteWrite(int fd) {
  Track([&] { state->unsynced.insert(PathOf(fd)); });
}

int Sync(int fd, const char* name) {
  if (Fails("sync")) return Refuse(EIO);
  const int result = Next<int(int)>(name)(fd);
  Track([&] {
    const std::string path = PathOf(fd);
    state->unsynced.erase(path);
    std::erase_if(state->renames, [&](const Rename& done) {
      if (done.to.substr(0, done.to.rfind('/')) != path) return false;
      if (!done.saved.empty()) unlink(done.saved.c_str());
      return true;
    });
  });
  return result;
}

// What holds for a name holds for all below it.
void MoveNames(const std::string& from, const std::string& to) {
  std::set<std::string> moved;
  for (const std::string& path : state->unsynced) {
    const bool is_below = path == from || path.starts_with(from + "/");
    moved.insert(is_below ? to + path.substr(from.size()) : path);
  }
  state->unsynced = std::move(moved);
}

int Renamed(const char* from, const char* to, unsigned flags) {
  if (Fails("rename")) return Refuse(ENOSPC);
  Rename done;
  Track([&] {
    done = {Absolute(from), Absolute(to), "", (flags & RENAME_EXCHANGE) != 0};
    done.saved = done.to + ".before-rename-" + std::to_string(state->renames.size());
    if (done.exchange || link(done.to.c_str(), done.saved.c_str()) != 0) done.saved.clear();
  });
  const int result = Next<int(int, const char*, int, const char*, unsigned)>("renameat2")(
      AT_FDCWD, from, AT_FDCWD, to, flags);
  const int error = errno;
  Track([&] {
    if (result == 0) {
      MoveNames(done.from, done.to);
      state->renames.push_back(done);
    } else if (!done.saved.empty()) {
      unlink(done.saved.c_str());
    }
  });
  errno = error;
  return result;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = va_arg(list, mode_t);
  va_end(list);
  if (Creates(flags) && FailsToCreate()) return Refuse(ENOSPC);
  return Next<int(const char*, int, ...)>("open")(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = va_arg(list, mode_t);
  va_end(list);
  return open(path, flags, mode);
}
FILE* fopen(const char* path, const char* mode) {
  if (*mode != 'r' && FailsToCreate()) {
    errno = ENOSPC;
    return nullptr;
  }
  return Next<FILE*(const char*, const char*)>("fopen")(path, mode);
}
FILE* fopen64(const char* path, const char* mode) { return fopen(path, mode); }

ssize_t write(int fd, const void* bytes, size_t n) {
  if (fd > STDERR_FILENO && Fails("write")) return Refuse(ENOSPC);
  const ssize_t result = Next<ssize_t(int, const void*, size_t)>("write")(fd, bytes, n);
  if (fd > STDERR_FILENO) NoteWrite(fd);
  return result;
}
ssize_t writev(int fd, const iovec* parts, int n) {
  if (fd > STDERR_FILENO && Fails("write")) return Refuse(ENOSPC);
  const ssize_t result = Next<ssize_t(int, const iovec*, int)>("writev")(fd, parts, n);
  if (fd > STDERR_FILENO) NoteWrite(fd);
  return result;
}

int fsync(int fd) { return Sync(fd, "fsync"); }
int fdatasync(int fd) { return Sync(fd, "fdatasync"); }

int rename(const char* from, const char* to) { return Renamed(from, to, 0); }
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  if (from_folder != AT_FDCWD || to_folder != AT_FDCWD) return Refuse(ENOTSUP);
  return Renamed(from, to, flags);
}

pid_t fork() {
  if (Fails("fork")) return Refuse(EAGAIN);
  return Next<pid_t()>("fork")();
}

int pthread_create(pthread_t* thread,
                   const pthread_attr_t* attributes,
                   void* (*body)(void*),
                   void* argument) {
  if (Fails("thread")) return EAGAIN;
  return Next<int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*)>("pthread_create")(
      thread, attributes, body, argument);
}

// OpenCV calls it with its first picture; for lack of memory GDAL itself aborts, or reads null. Not counted.
void GDALAllRegister() {
  const bool was_inside = std::exchange(inside, true);
  Next<void()>("GDALAllRegister")();
  inside = was_inside;
}

void* malloc(size_t n) {
  if (Fails("malloc")) {
    errno = ENOMEM;
    return nullptr;
  }
  return __libc_malloc(n);
}
void* calloc(size_t n, size_t size) {
  if (Fails("malloc")) {
    errno = ENOMEM;
    return nullptr;
  }
  return __libc_calloc(n, size);
}
void* realloc(void* old, size_t n) {
  if (Fails("malloc")) {
    errno = ENOMEM;
    return nullptr;
  }
  return __libc_realloc(old, n);
}
}
