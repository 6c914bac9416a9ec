#include "io/base/packed.h"

#include <gtest/gtest.h>

#include <array>

#include "io/base/error.h"

namespace {

TEST(Packed, ValuesComeBackInTheirOrder) {
  const std::vector<std::vector<std::array<int, 2>>> nested = {{{1, 2}, {3, 4}}, {}, {{-5, 6}}};
  const std::vector<std::string> names = {"a", "", std::string("b\0c", 3)};
  const float values[] = {1, 2};
  const std::string bytes = io::Packer()
                                .Add(1.5)
                                .Add(names)
                                .Add(nested)
                                .AddValues(values, 2)
                                .Add(true)
                                .Add(std::string("end"))
                                .Take();
  io::Unpacker packed(bytes);
  EXPECT_EQ(packed.Take<double>(), 1.5);
  EXPECT_EQ(packed.Take<std::vector<std::string>>(), names);
  EXPECT_EQ((packed.Take<std::vector<std::vector<std::array<int, 2>>>>()), nested);
  float taken[2];
  packed.TakeValues(taken, 2);
  EXPECT_EQ(taken[1], 2);
  EXPECT_TRUE(packed.Take<bool>());
  EXPECT_FALSE(packed.IsEmpty());
  EXPECT_EQ(packed.Take<std::string>(), "end");
  EXPECT_TRUE(packed.IsEmpty());
}

TEST(Packed, MoreThanThereIsIsRefused) {
  const std::string bytes = io::Packer().Add(std::string("four")).Take();
  const auto taken = [](std::string_view part) { return io::Unpacker(part).Take<std::string>(); };
  EXPECT_EQ(taken(bytes), "four");
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_THROW(taken(std::string_view(bytes).substr(0, n)), io::Error) << n;
}

}  // namespace
