// Support for tests: two ranks, this process and a child of it.
#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/process/ranks.h"

class SocketRanks : public io::Ranks {
 public:
  SocketRanks(int rank, int socket) : rank_(rank), socket_(socket) {}
  ~SocketRanks() override { close(socket_); }
  int rank() const override { return rank_; }
  int size() const override { return 2; }
  std::vector<std::string> AllGather(std::string bytes) override {
    std::string other;
    if (rank_ == 0) Write(bytes);
    Read(&other);
    if (rank_ == 1) Write(bytes);
    return rank_ == 0 ? std::vector{bytes, other} : std::vector{other, bytes};
  }
  void Broadcast(std::string* bytes) override { rank_ == 0 ? Write(*bytes) : Read(bytes); }
  void Leave() override {}

 private:
  void Write(const std::string& bytes) const {
    const std::uint64_t length = bytes.size();
    std::string message(reinterpret_cast<const char*>(&length), sizeof length);
    message += bytes;
    for (std::size_t at = 0; at < message.size();) {
      const ssize_t n = send(socket_, message.data() + at, message.size() - at, MSG_NOSIGNAL);
      if (n <= 0) throw std::runtime_error("the other rank does not listen");
      at += static_cast<std::size_t>(n);
    }
  }
  void ReadAll(void* to, std::size_t size) const {
    for (std::size_t at = 0; at < size;) {
      const ssize_t n = recv(socket_, static_cast<char*>(to) + at, size - at, 0);
      if (n <= 0) throw std::runtime_error("the other rank has ended");
      at += static_cast<std::size_t>(n);
    }
  }
  void Read(std::string* bytes) const {
    std::uint64_t length = 0;
    ReadAll(&length, sizeof length);
    bytes->resize(length);
    ReadAll(bytes->data(), length);
  }

  const int rank_, socket_;
};

// Calls `first` as rank 0 of two, whose other one calls `second` in a process of its own, without threads of
// this one. An exception of `first` is passed on. Returns the exit code of the other: 0 when `second`
// returned.
inline int OnTwoRanks(const std::function<void()>& first, const std::function<void()>& second) {
  int sockets[2];
  EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM, 0, sockets), 0);
  const pid_t child = fork();
  if (child == 0) {
    close(sockets[0]);
    io::UseRanks(std::make_unique<SocketRanks>(1, sockets[1]));
    try {
      second();
      _exit(0);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "rank 1: %s\n", error.what());
      _exit(1);
    }
  }
  close(sockets[1]);
  std::unique_ptr<io::Ranks> before = io::UseRanks(std::make_unique<SocketRanks>(0, sockets[0]));
  std::exception_ptr exception;
  try {
    first();
  } catch (...) {
    exception = std::current_exception();
  }
  io::UseRanks(std::move(before));
  int status = 0;
  waitpid(child, &status, 0);
  if (exception) std::rethrow_exception(exception);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}
