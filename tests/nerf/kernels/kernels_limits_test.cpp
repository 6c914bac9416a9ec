// The probes of nerf/kernels/limits.h do the work that they claim: otherwise every percentage would be wrong.
#include "nerf/kernels/limits.h"

#include <gtest/gtest.h>

#include <cstring>
#include <numeric>
#include <vector>

namespace nerf::kernels {
namespace {

constexpr std::uint32_t kEntries = 1 << 12;
constexpr int kRounds = 3;

std::vector<std::uint32_t> Picks() {
  std::vector<std::uint32_t> picks(kPicks);
  for (std::uint32_t i = 0; i < kPicks; ++i) picks[i] = i * 977 % kEntries;
  return picks;
}

// The entries that the rounds visit.
std::vector<std::uint32_t> Visited() {
  std::vector<std::uint32_t> visited;
  for (std::uint32_t round = 0; round < kRounds; ++round) {
    for (const std::uint32_t pick : Picks()) visited.push_back(pick ^ (round * 2654435761u & (kEntries - 1)));
  }
  return visited;
}

TEST(KernelsLimits, MultiplyAddsRunInEveryChain) {
  int probes = 0;
  for (const char* name : {"portable", "avx2", "avx512", "avx512bf16"}) {
    const ArithmeticProbe* probe = FindArithmeticProbe(name);
    EXPECT_EQ(probe != nullptr, FindKernels(name) != nullptr) << name;
    if (!probe) continue;
    ++probes;
    std::vector<float> sums(kProbeSums, 1.f);
    const auto chained = static_cast<std::size_t>(probe->fp32(1, sums.data()) / 2);
    ASSERT_LE(chained, sums.size()) << name;
    for (std::size_t i = 0; i < sums.size(); ++i) EXPECT_EQ(sums[i], i < chained ? 0.75f : 1.f) << name << i;
    EXPECT_EQ(probe->fp32(10, sums.data()), 20. * static_cast<double>(chained));
    EXPECT_EQ(probe->bf16 != nullptr, std::strcmp(name, "avx512bf16") == 0);
    if (!probe->bf16) continue;
    sums.assign(kProbeSums, 1.f);
    EXPECT_EQ(probe->bf16(4, sums.data()), 4. * 4 * kProbeSums);  // two products per sum
    for (const float sum : sums) EXPECT_EQ(sum, 1.f + 4 * 0x1p-13f);
  }
  EXPECT_GE(probes, 1);
}

TEST(KernelsLimits, GathersReadWholeEntries) {
  std::vector<float> table(kFeatures * kEntries);
  std::vector<Bf16> rounded(table.size());
  for (std::size_t i = 0; i < table.size(); ++i) {
    table[i] = static_cast<float>(i);
    rounded[i] = Bf16{static_cast<std::uint16_t>(i)};
  }
  std::uint64_t wide = 0, narrow = 0;
  for (const std::uint32_t entry : Visited()) {
    std::uint64_t words[2], word;
    std::memcpy(words, &table[std::size_t{kFeatures} * entry], sizeof words);
    std::memcpy(&word, &rounded[std::size_t{kFeatures} * entry], sizeof word);
    wide += words[0] + words[1];
    narrow += word;
  }
  EXPECT_EQ(GatherEntries(table.data(), kEntries - 1, Picks().data(), kRounds), wide);
  EXPECT_EQ(GatherEntries(rounded.data(), kEntries - 1, Picks().data(), kRounds), narrow);
}

TEST(KernelsLimits, UpdatesAddToWholeEntries) {
  std::vector<float> table(kFeatures * kEntries, 0.f), want = table;
  UpdateEntries(table.data(), kEntries - 1, Picks().data(), kRounds);
  for (const std::uint32_t entry : Visited()) {
    for (int f = 0; f < kFeatures; ++f)
      want[std::size_t{kFeatures} * entry + static_cast<std::size_t>(f)] += 0.25f;
  }
  EXPECT_EQ(table, want);
}

TEST(KernelsLimits, StreamsVisitEveryValue) {
  std::vector<float> values(160);
  std::vector<std::uint64_t> words(values.size() / 2);
  std::iota(values.begin(), values.end(), 1.f);
  std::memcpy(words.data(), values.data(), values.size() * sizeof(float));
  EXPECT_EQ(StreamRead(values.size(), values.data()),
            std::accumulate(words.begin(), words.end(), std::uint64_t{0}));
  StreamUpdate(values.size(), values.data());
  for (std::size_t i = 0; i < values.size(); ++i)
    EXPECT_EQ(values[i], 0.5f * static_cast<float>(i + 1) + 0.25f);
}

}  // namespace
}  // namespace nerf::kernels
