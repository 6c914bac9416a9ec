// io/base/quoting.h: what a shell and a reader of CSV give back is the text that went in.
#include "io/base/quoting.h"

#include "io/base/process.h"
#include "tests/support/temp_dir.h"

namespace {

TEST(Quoting, TheShellReadsTheSameWords) {
  EXPECT_EQ(io::ShellWord("--size=1.5,2"), "--size=1.5,2");
  EXPECT_EQ(io::ShellWord(""), "''");
  EXPECT_EQ(io::ShellWord("it's"), "'it'\\''s'");
  for (const std::string word : {"a b", "it's", "''", "$HOME `ls` \\ \"x\"", "*?[", "a\nb", "ünï", "~"}) {
    const TempDir dir;
    const io::ProcessReport report =
        io::RunProcess({"/bin/sh", "-c", "printf %s " + io::ShellWord(word)}, {.log_path = dir / "out"});
    EXPECT_TRUE(report.Ok()) << word;
    EXPECT_EQ(ReadText(dir / "out"), word);
  }
}

TEST(Quoting, FieldsOfCsvAreQuotedWhereNeeded) {
  for (const std::string field : {"", "a", "b c", "it's"}) EXPECT_EQ(io::CsvField(field), field);
  EXPECT_EQ(io::CsvField("1,5"), "\"1,5\"");
  EXPECT_EQ(io::CsvField("say \"so\""), "\"say \"\"so\"\"\"");
  EXPECT_EQ(io::CsvField("two\nlines"), "\"two\nlines\"");
  EXPECT_EQ(io::CsvField("a\rb"), "\"a\rb\"");
  EXPECT_EQ(io::CsvQuoted("a"), "\"a\"");
}

}  // namespace
