// Probes of what the processor can do at most. Compiled for the plain processor; those of an instruction set
// carry its name. Sums start from memory, so that chains stay apart, and end there, so that they stay at all.
#include "nerf/kernels/limits.h"

#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace nerf::kernels {
namespace {

// s = 0.5 s + 0.25 tends to 0.5: neither overflow nor denormal numbers, which would be slow.
constexpr float kFactor = 0.5f, kAddend = 0.25f;
// Chains hide the latency of up to two instructions per cycle, and fit the registers beside two constants.
constexpr int kSums = 12, kWideSums = 16;

typedef float Four __attribute__((vector_size(16)));

double MultiplyAddsPortable(int rounds, float* sums) {
  Four sum[kSums];
  std::memcpy(sum, sums, sizeof sum);
  for (int i = 0; i < rounds; ++i) {
    for (Four& s : sum) s = s * kFactor + kAddend;
  }
  std::memcpy(sums, sum, sizeof sum);
  return 2.0 * 4 * kSums * rounds;
}
constexpr ArithmeticProbe kPortableProbe = {MultiplyAddsPortable, nullptr};

#if defined(__x86_64__)
[[gnu::target("avx2,fma")]] double MultiplyAddsAvx2(int rounds, float* sums) {
  __m256 sum[kSums];
  for (int k = 0; k < kSums; ++k) sum[k] = _mm256_loadu_ps(sums + 8 * k);
  const __m256 factor = _mm256_set1_ps(kFactor), addend = _mm256_set1_ps(kAddend);
  for (int i = 0; i < rounds; ++i) {
    for (__m256& s : sum) s = _mm256_fmadd_ps(s, factor, addend);
  }
  for (int k = 0; k < kSums; ++k) _mm256_storeu_ps(sums + 8 * k, sum[k]);
  return 2.0 * 8 * kSums * rounds;
}

[[gnu::target("avx512f")]] double MultiplyAddsAvx512(int rounds, float* sums) {
  __m512 sum[kWideSums];
  for (int k = 0; k < kWideSums; ++k) sum[k] = _mm512_loadu_ps(sums + 16 * k);
  const __m512 factor = _mm512_set1_ps(kFactor), addend = _mm512_set1_ps(kAddend);
  for (int i = 0; i < rounds; ++i) {
    for (__m512& s : sum) s = _mm512_fmadd_ps(s, factor, addend);
  }
  for (int k = 0; k < kWideSums; ++k) _mm512_storeu_ps(sums + 16 * k, sum[k]);
  return 2.0 * 16 * kWideSums * rounds;
}

[[gnu::target("avx512f,avx512bw,avx512vl,avx512bf16")]] double DotsAvx512Bf16(int rounds, float* sums) {
  __m512 sum[kWideSums];
  for (int k = 0; k < kWideSums; ++k) sum[k] = _mm512_loadu_ps(sums + 16 * k);
  const __m512bh one = (__m512bh)_mm512_set1_epi16(0x3f80);
  const __m512bh small = (__m512bh)_mm512_set1_epi16(0x3880);  // 2^-14
  for (int i = 0; i < rounds; ++i) {
    for (__m512& s : sum) s = _mm512_dpbf16_ps(s, one, small);
  }
  for (int k = 0; k < kWideSums; ++k) _mm512_storeu_ps(sums + 16 * k, sum[k]);
  return 2.0 * 32 * kWideSums * rounds;
}

constexpr ArithmeticProbe kAvx2Probe = {MultiplyAddsAvx2, nullptr};
constexpr ArithmeticProbe kAvx512Probe = {MultiplyAddsAvx512, nullptr};
constexpr ArithmeticProbe kAvx512Bf16Probe = {MultiplyAddsAvx512, DotsAvx512Bf16};
#endif

typedef std::uint64_t Sixteen __attribute__((vector_size(16)));
constexpr int kChains = 4;

// Where the picks of a round lie: any entry in its turn.
std::uint32_t Offset(int round, std::uint32_t mask) {
  return static_cast<std::uint32_t>(round) * 2654435761u & mask;
}

template <typename Entry, typename Real>
Entry Gather(const Real* table, std::uint32_t mask, const std::uint32_t* picks, int rounds) {
  static_assert(sizeof(Entry) == kFeatures * sizeof(Real));
  Entry sums[kChains] = {};
  for (int round = 0; round < rounds; ++round) {
    const std::uint32_t offset = Offset(round, mask);
    for (int i = 0; i < kPicks; i += kChains) {
      for (int k = 0; k < kChains; ++k) {
        Entry entry;
        std::memcpy(&entry, table + std::size_t{kFeatures} * (picks[i + k] ^ offset), sizeof entry);
        sums[k] += entry;
      }
    }
  }
  return sums[0] + sums[1] + sums[2] + sums[3];
}

}  // namespace

const ArithmeticProbe* FindArithmeticProbe(const char* name) {
  if (!FindKernels(name)) return nullptr;
#if defined(__x86_64__)
  if (std::strcmp(name, "avx2") == 0) return &kAvx2Probe;
  if (std::strcmp(name, "avx512") == 0) return &kAvx512Probe;
  if (std::strcmp(name, "avx512bf16") == 0) return &kAvx512Bf16Probe;
#endif
  return &kPortableProbe;
}

std::uint64_t GatherEntries(const float* table, std::uint32_t mask, const std::uint32_t* picks, int rounds) {
  const Sixteen sum = Gather<Sixteen>(table, mask, picks, rounds);
  return sum[0] + sum[1];
}
std::uint64_t GatherEntries(const Bf16* table, std::uint32_t mask, const std::uint32_t* picks, int rounds) {
  return Gather<std::uint64_t>(table, mask, picks, rounds);
}

void UpdateEntries(float* table, std::uint32_t mask, const std::uint32_t* picks, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    const std::uint32_t offset = Offset(round, mask);
    for (int i = 0; i < kPicks; ++i) {
      float* at = table + std::size_t{kFeatures} * (picks[i] ^ offset);
      Four entry;
      std::memcpy(&entry, at, sizeof entry);
      entry += kAddend;
      std::memcpy(at, &entry, sizeof entry);
    }
  }
}

std::uint64_t StreamRead(std::size_t n, const float* values) {
  Sixteen sums[kChains] = {};
  for (std::size_t i = 0; i < n; i += 4 * kChains) {
    for (std::size_t k = 0; k < kChains; ++k) {
      Sixteen four;
      std::memcpy(&four, values + i + 4 * k, sizeof four);
      sums[k] += four;
    }
  }
  const Sixteen sum = sums[0] + sums[1] + sums[2] + sums[3];
  return sum[0] + sum[1];
}

void StreamUpdate(std::size_t n, float* values) {
  for (std::size_t i = 0; i < n; i += 4 * kChains) {
    for (std::size_t k = 0; k < kChains; ++k) {
      Four four;
      std::memcpy(&four, values + i + 4 * k, sizeof four);
      four = four * kFactor + kAddend;
      std::memcpy(values + i + 4 * k, &four, sizeof four);
    }
  }
}

}  // namespace nerf::kernels
