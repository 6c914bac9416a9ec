#include "nerf/ranks/gloo_ranks.h"

#include <ATen/ops/from_blob.h>
#include <fmt/format.h>
#include <torch/csrc/distributed/c10d/PrefixStore.hpp>
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>
#include <torch/csrc/distributed/c10d/TCPStore.hpp>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/process/interrupt.h"
#include "nerf/ranks/gloo_device.h"
#include "nerf/ranks/local_address.h"
#include "nerf/ranks/messages.h"
#include "nerf/ranks/patience.h"

namespace nerf {
namespace {

using io::Error;
using io::ExitCode;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
using WorkPtr = c10::intrusive_ptr<c10d::Work>;

constexpr milliseconds kBeatEvery(250);
// How long a rank waits for others to say why a connection broke, and for their last words.
constexpr std::chrono::seconds kVerdict(3);
// Exchanges may take as long as another rank computes: whether it lives, the beats say.
constexpr std::chrono::hours kForever(24 * 365);
constexpr int kHeadTag = 1, kRestTag = 2, kBeatTag = 3;

class GlooRanks : public io::Ranks {
 public:
  GlooRanks(const io::Meeting& meeting, Patience* patience);
  ~GlooRanks() override { End(State::kFailed); }

  int rank() const override { return meeting_.rank; }
  int size() const override { return meeting_.size; }
  std::vector<std::string> AllGather(std::string bytes) override;
  void Broadcast(std::string* bytes) override;
  void Leave() override { End(State::kLeft); }

 private:
  // A message under way.
  struct Transfer {
    int peer;
    WorkPtr work;
  };

  void Meet(Patience* patience);
  void RequireSecret();
  std::string Name(int rank) const;
  bool IsMine(int rank) const { return rank == meeting_.rank; }
  using PostFunction = const std::function<WorkPtr(std::vector<at::Tensor>&)>&;
  Transfer Post(int peer, void* data, std::size_t n, PostFunction post) const;
  Transfer Send(int peer, int tag, void* data, std::size_t n) const;
  Transfer Receive(int peer, int tag, void* data, std::size_t n) const;
  void SendTo(int peer, Head* head, std::string* bytes, std::vector<Transfer>* sends) const;
  void ReceiveRest(int peer, const Head& head, std::string* bytes, std::vector<Transfer>* receipts) const;
  static bool IsDone(const Transfer& transfer, milliseconds timeout);
  void Await(const std::vector<Transfer>& transfers);
  void Watch(int peer);
  void Exchange(int peer);
  void EndAwaiting();
  void Miss(int peer);
  void StopFor(int lost, const std::string& how);
  void End(State state);

  const io::Meeting meeting_;
  std::vector<std::string> hosts_;
  c10::intrusive_ptr<c10d::Store> store_;
  c10::intrusive_ptr<c10d::ProcessGroupGloo> group_;
  std::mutex mutex_;
  std::condition_variable state_changed_;
  State state_ = State::kWorking;
  std::int32_t lost_ = -1;
  std::vector<Transfer> awaited_;               // by the thread that computes
  std::vector<std::atomic<Clock::rep>> heard_;  // when a rank last gave a sign of life
  std::vector<std::thread> watchers_;           // one per other rank
};

GlooRanks::GlooRanks(const io::Meeting& meeting, Patience* patience)
    : meeting_(meeting), hosts_(static_cast<std::size_t>(meeting.size)), heard_(hosts_.size()) {
  Meet(patience);
  for (auto& time : heard_) time = Clock::now().time_since_epoch().count();
  try {
    for (int r = 0; r < meeting_.size; ++r) {
      if (!IsMine(r)) watchers_.emplace_back([this, r] { Watch(r); });
    }
    RequireSecret();
  } catch (...) {  // the destructor is not called, and threads that are not joined end the process
    End(State::kFailed);
    throw;
  }
}

std::string GlooRanks::Name(int rank) const {
  return fmt::format("rank {} ({})", rank, hosts_[static_cast<std::size_t>(rank)]);
}

void GlooRanks::Meet(Patience* patience) {
  const std::string place = fmt::format("{}:{}", meeting_.address, meeting_.port);
  patience->WaitFor("rank 0 at " + place);
  c10d::TCPStoreOptions options;
  options.port = meeting_.port;
  options.isServer = meeting_.rank == 0 && !meeting_.has_store;
  options.waitWorkers = false;
  options.timeout = meeting_.patience + std::chrono::minutes(1);  // patience ends first
  try {
    store_ = c10::make_intrusive<c10d::TCPStore>(meeting_.address, options);
  } catch (const std::exception& error) {
    if (!options.isServer) throw Error(ExitCode::kLostRank, "no rank 0 at " + place);
    throw Error(
        ExitCode::kLocked,
        place + ": rank 0 cannot listen there",
        "Another run may use the port: choose another MASTER_PORT; MASTER_ADDR is the address of rank 0");
  }
  store_ = c10::make_intrusive<c10d::PrefixStore>(meeting_.secret, store_);
  if (store_->add(fmt::format("here/{}", meeting_.rank), 1) != 1) {
    throw Error(ExitCode::kLocked,
                fmt::format("{}: rank {} is there already", place, meeting_.rank),
                "Another run uses run folder and port: wait for it, or choose another MASTER_PORT");
  }
  const std::string host = HostName();
  store_->set(fmt::format("host/{}", meeting_.rank), std::vector<std::uint8_t>(host.begin(), host.end()));
  for (int r = 0; r < meeting_.size; ++r) {
    patience->WaitFor(fmt::format("rank {} to start", r));
    const std::vector<std::uint8_t> name = store_->get(fmt::format("host/{}", r));
    hosts_[static_cast<std::size_t>(r)].assign(name.begin(), name.end());
  }
  patience->WaitFor("connections to all ranks");
  const auto gloo = c10d::ProcessGroupGloo::Options::create(kForever);
  gloo->devices = {MakeGlooDevice(LocalAddress(meeting_.address))};
  gloo->threads = 1;
  group_ = c10::make_intrusive<c10d::ProcessGroupGloo>(
      c10::make_intrusive<c10d::PrefixStore>("gloo", store_), meeting_.rank, meeting_.size, gloo);
}

// Also of whom connected to us without the store.
void GlooRanks::RequireSecret() {
  const auto proof = [&](int rank) { return io::HashBytes(fmt::format("{} {}", meeting_.secret, rank)); };
  const std::vector<std::string> proofs = AllGather(proof(meeting_.rank));
  for (int r = 0; r < meeting_.size; ++r) {
    if (proofs[static_cast<std::size_t>(r)] != proof(r))
      throw Error(ExitCode::kLostRank, Name(r) + " does not know the secret of this run folder");
  }
}

GlooRanks::Transfer GlooRanks::Post(int peer, void* data, std::size_t n, PostFunction post) const {
  std::vector<at::Tensor> tensors = {at::from_blob(data, {static_cast<std::int64_t>(n)}, at::kByte)};
  try {
    return {peer, post(tensors)};
  } catch (const std::exception&) {  // the connection is closed: its watcher knows why
    return {peer, WorkPtr()};
  }
}

GlooRanks::Transfer GlooRanks::Send(int peer, int tag, void* data, std::size_t n) const {
  return Post(peer, data, n, [&](auto& tensors) { return group_->send(tensors, peer, tag); });
}

GlooRanks::Transfer GlooRanks::Receive(int peer, int tag, void* data, std::size_t n) const {
  return Post(peer, data, n, [&](auto& tensors) { return group_->recv(tensors, peer, tag); });
}

bool GlooRanks::IsDone(const Transfer& transfer, milliseconds timeout) {
  try {
    return transfer.work && transfer.work->wait(timeout);
  } catch (const std::exception&) {
    return false;
  }
}

// Of the thread that computes. Throws Interrupted when this rank is to stop, or a rank is lost.
void GlooRanks::Await(const std::vector<Transfer>& transfers) {
  {
    const std::lock_guard lock(mutex_);
    awaited_ = transfers;
  }
  const auto undone = std::find_if(transfers.begin(), transfers.end(), [](const Transfer& transfer) {
    return !IsDone(transfer, kNoTimeout);
  });
  {
    const std::lock_guard lock(mutex_);
    awaited_.clear();
  }
  if (undone == transfers.end()) return;
  const Clock::time_point end = Clock::now() + kVerdict;
  while (io::PendingInterrupt() == 0 && Clock::now() < end) std::this_thread::sleep_for(kBeatEvery / 10);
  if (io::PendingInterrupt() == 0) StopFor(undone->peer, "the connection to it broke");
  io::ThrowIfInterrupted();
}

std::vector<std::string> GlooRanks::AllGather(std::string bytes) {
  const auto size = static_cast<std::size_t>(meeting_.size), own = static_cast<std::size_t>(meeting_.rank);
  std::vector<std::string> all(size);
  std::vector<Head> heads(size, HeadOf(bytes));
  std::vector<Transfer> sends, receipts;
  for (std::size_t r = 0; r < size; ++r) {
    if (r == own) continue;
    const int peer = static_cast<int>(r);
    receipts.push_back(Receive(peer, kHeadTag, &heads[r], sizeof heads[r]));
    SendTo(peer, &heads[own], &bytes, &sends);
  }
  Await(receipts);
  receipts.clear();
  for (std::size_t r = 0; r < size; ++r) {
    if (r != own) ReceiveRest(static_cast<int>(r), heads[r], &all[r], &receipts);
  }
  Await(receipts);
  Await(sends);
  all[own] = std::move(bytes);
  return all;
}

void GlooRanks::Broadcast(std::string* bytes) {
  Head head = HeadOf(*bytes);
  std::vector<Transfer> transfers;
  if (meeting_.rank != 0) {
    Await({Receive(0, kHeadTag, &head, sizeof head)});
    ReceiveRest(0, head, bytes, &transfers);
  } else {
    for (int r = 1; r < meeting_.size; ++r) SendTo(r, &head, bytes, &transfers);
  }
  Await(transfers);
}

void GlooRanks::SendTo(int peer, Head* head, std::string* bytes, std::vector<Transfer>* sends) const {
  // The rest first: whoever waits for it asks when the head is there, and the device's thread then sends it.
  // Sent by this thread it would keep a connection's lock for as long.
  if (bytes->size() > kHeadBytes)
    sends->push_back(Send(peer, kRestTag, bytes->data() + kHeadBytes, bytes->size() - kHeadBytes));
  sends->push_back(Send(peer, kHeadTag, head, sizeof *head));
}

void GlooRanks::ReceiveRest(int peer,
                            const Head& head,
                            std::string* bytes,
                            std::vector<Transfer>* receipts) const {
  bytes->assign(head.bytes.data(), std::min<std::size_t>(head.length, kHeadBytes));
  bytes->resize(head.length);
  if (head.length > kHeadBytes)
    receipts->push_back(Receive(peer, kRestTag, bytes->data() + kHeadBytes, bytes->size() - kHeadBytes));
}

// The thread of one other rank. What was sent as its connection broke may never hear of that: aborted.
void GlooRanks::Watch(int peer) {
  Exchange(peer);
  std::unique_lock lock(mutex_);
  for (; state_ == State::kWorking; state_changed_.wait_for(lock, kBeatEvery)) EndAwaiting();
}

// Of a rank that is to stop; with mutex_.
void GlooRanks::EndAwaiting() {
  if (io::PendingInterrupt() == 0) return;
  for (const Transfer& transfer : awaited_) {
    if (transfer.work) transfer.work->abort();
  }
}

// Signs of life with one rank, until one of both ends.
void GlooRanks::Exchange(int peer) {
  for (;;) {
    Beat mine, theirs;
    {
      const std::lock_guard lock(mutex_);
      mine = {state_, lost_};
    }
    const Transfer receipt = Receive(peer, kBeatTag, &theirs, sizeof theirs),
                   send = Send(peer, kBeatTag, &mine, sizeof mine);
    if (!IsDone(receipt, kSilence) || !IsDone(send, kSilence)) return Miss(peer);
    heard_[static_cast<std::size_t>(peer)] = Clock::now().time_since_epoch().count();
    if (theirs.state == State::kFailed && mine.state == State::kWorking) {
      const bool for_another = theirs.lost >= 0 && theirs.lost != meeting_.rank;
      StopFor(for_another ? theirs.lost : peer,
              for_another ? "as " + Name(peer) + " says" : "it has stopped; its own output says why");
    }
    if (theirs.state != State::kWorking || mine.state != State::kWorking) return;
    std::unique_lock lock(mutex_);
    state_changed_.wait_for(lock, kBeatEvery, [&] { return state_ != State::kWorking; });
    EndAwaiting();
  }
}

// The connection to `peer` broke, or nothing came for kSilence. When another rank stays silent for longer,
// `peer` has missed that one first and ended.
void GlooRanks::Miss(int peer) {
  const auto silence = [&](int r) {
    return Clock::now() - Clock::time_point(Clock::duration(heard_[static_cast<std::size_t>(r)]));
  };
  int lost = peer, n_silent = 0;
  for (int r = 0; r < meeting_.size; ++r) {
    if (IsMine(r) || silence(r) < kSilence / 2) continue;
    ++n_silent;
    if (silence(r) > silence(lost)) lost = r;
  }
  if (n_silent == 0) return StopFor(peer, "its process or its connection ended");
  StopFor(lost,
          fmt::format("no sign of life for {} s{}",
                      std::chrono::round<std::chrono::seconds>(silence(lost)).count(),
                      n_silent > 1 ? ", nor of others: this rank may be cut off" : ""));
}

void GlooRanks::StopFor(int lost, const std::string& how) {
  {
    const std::lock_guard lock(mutex_);
    if (state_ != State::kWorking) return;
    if (lost_ < 0) lost_ = lost;
  }
  io::StopBecause(Error(ExitCode::kLostRank,
                        fmt::format("{} is lost: {}", Name(lost), how),
                        "Nothing that is on disk is lost: start all ranks again, in any number"));
}

void GlooRanks::End(State state) {
  {
    const std::lock_guard lock(mutex_);
    if (state_ != State::kWorking) return;
    state_ = state;
  }
  state_changed_.notify_all();
  for (std::thread& watcher : watchers_) watcher.join();
}

}  // namespace

std::unique_ptr<io::Ranks> JoinByGloo(const io::Meeting& meeting) {
  setenv("TORCH_CPP_LOG_LEVEL", "ERROR", 0);  // of attempts to connect before rank 0 listens
  Patience patience(meeting.rank, meeting.patience);
  return std::make_unique<GlooRanks>(meeting, &patience);
}

}  // namespace nerf
