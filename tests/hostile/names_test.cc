// Unusual names of files.
#include <sys/stat.h>

#include <filesystem>

#include "hostile/hostile_test.h"
#include "thicklens/base/output_file.h"

namespace thicklens::hostile {
namespace {

using HostileNames = HostileTest;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

THICKLENS_SITUATION(HostileNames, ANewlineIsShownInOneLine,
                    "A file whose name has a newline in it is an input that is missing, and an "
                    "output",
                    "The error is one line that names the file; the output is complete") {
  const std::string name = "first\nsecond.json";
  ExpectRefused(Shell("\"$T\" explain " + Quoted(name) + " --depth-range 290:310"), 1,
                {"first", "second.json", "No such file"});
  ExpectDone(Shell(Explain(Quoted(name))), {"new " + name});
}

THICKLENS_SITUATION(
    HostileNames, ControlCharactersDoNotReachTheTerminal,
    "File names, a camera name, YAML values and table cells contain escape sequences, tabs and "
    "bells",
    "The text that the program prints contains no control characters except newlines") {
  const std::string sequence = "\x1b]0;title\x07\x1b[2J";
  ExpectRefused(Shell("\"$T\" explain " + Quoted(sequence) + " --depth-range 290:310"), 1,
                {"title", "No such file"});
  const std::string camera = testing::ContentOf(Work("camera.yaml"));
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = camera;
    return changed.replace(changed.find(from), from.size(), to);
  };
  Put("psf.yaml", with("psf: gaussian", "psf: \"\\e]0;title\\a\\e[2J\""));
  ExpectRefused(Shell("\"$T\" explain psf.yaml --depth-range 290:310"), 1, {"psf.yaml:", "title"});
  Put("table.csv", "file,reading\n" + sequence + ",3\n");
  ExpectRefused(Shell("mkdir none; \"$T\" calibrate none --readings table.csv --camera "
                      "camera.yaml -o new.yaml; code=$?; rmdir none; exit $code"),
                1, {"table.csv:2", "title"});
  Put("name.yaml", with("name: small", "name: \"\\e]0;title\\a\\t\\e[2J\""));
  const Outcome outcome = Shell("\"$T\" explain name.yaml --depth-range 290:310");
  ExpectDone(outcome, {});
  for (const std::string& printed : {outcome.out, outcome.err}) {
    EXPECT_THAT(printed, HasSubstr("title"));
    for (const char c : printed) EXPECT_TRUE(c == '\n' || static_cast<unsigned char>(c) >= 0x20);
  }
}

THICKLENS_SITUATION(HostileNames, QuotesBlanksAndDollarSigns,
                    "Names with blanks, quotation marks, backslashes, `$(...)` and backquotes are "
                    "inputs and outputs",
                    "The command succeeds; nothing else is run and no other file appears") {
  const std::string name = " a'b\"c \\ $(touch run) `touch run` ; touch run & *?[x] ~ #";
  ExpectDone(Shell("cp camera.yaml " + Quoted(name)), {"new " + name});
  const std::string output = name + ".json";
  ExpectDone(Shell("\"$T\" explain " + Quoted(name) + " --depth-range 290:310 --quiet --json " +
                   Quoted(output)),
             {"new " + output});
  ExpectDone(Shell(Estimate(Quoted(name + " lf"))), {"new " + name + " lf"});
  EXPECT_TRUE(std::filesystem::exists(Work(name + " lf/lightfield.yaml")));
}

THICKLENS_SITUATION(HostileNames, ALeadingDash,
                    "Names begin with a dash: inputs after `--`, outputs after `=` and `./`",
                    "The command succeeds") {
  ExpectDone(Shell("cp camera.yaml ./-camera.yaml; \"$T\" explain --depth-range 290:310 --quiet "
                   "--json=-a.json -- -camera.yaml"),
             {"new -a.json", "new -camera.yaml"});
  ExpectDone(Shell(Explain("./--quiet")), {"new --quiet"});
}

THICKLENS_SITUATION(HostileNames, BytesThatAreNoUtf8, "Names contain bytes that are not UTF-8",
                    "Inputs are read and outputs get exactly that name; messages and JSON are "
                    "UTF-8 with a replacement character") {
  const std::string name = "\xff\xfe\xc3(";
  ExpectDone(Shell("cp camera.yaml " + Quoted(name) + "; \"$T\" explain " + Quoted(name) +
                   " --depth-range 290:310 --quiet --json " + Quoted(name + ".json")),
             {"new " + name, "new " + name + ".json"});
  const Outcome outcome =
      Shell("\"$T\" explain " + Quoted(name + "?") + " --depth-range 290:310 --json refused.json");
  EXPECT_EQ(outcome.exit_code, 1);
  for (const std::string& text : {outcome.err, testing::ContentOf(Work("refused.json"))}) {
    EXPECT_THAT(text, HasSubstr("\xEF\xBF\xBD"));
    EXPECT_THAT(text, Not(HasSubstr("\xff")));
  }
}

THICKLENS_SITUATION(HostileNames, PercentSignsAndBraces, "Names contain `%s`, `%n`, `{}` and `{0}`",
                    "They are shown and used as they are") {
  const std::string name = "%s%n%99999999d{}{0:>99999999}";
  ExpectRefused(Shell("\"$T\" explain " + Quoted(name) + " --depth-range 290:310"), 1, {name});
  ExpectDone(Shell(Explain(Quoted(name))), {"new " + name});
  ExpectDone(Shell(Estimate(Quoted(name + "lf"))), {"new " + name + "lf"});
}

THICKLENS_SITUATION(HostileNames, ANameOf255Bytes,
                    "The name of an output file and of an output folder is as long as a name may "
                    "be, 255 bytes",
                    "The outputs are written, also where they replace others") {
  const std::string file(255, 'f'), folder(255, 'd');
  ExpectDone(Shell(Explain(file)), {"new " + file});
  ExpectDone(Shell(Estimate(folder)), {"new " + folder});
  EXPECT_EQ(Shell(Explain(file)).exit_code, 0);
  EXPECT_EQ(Shell(Estimate(folder)).exit_code, 0);
}

THICKLENS_SITUATION(HostileNames, ANameOf256Bytes,
                    "The name of an input or output is longer than a name may be",
                    "Refused before any work, with the reason that the system gives") {
  const std::string name(256, 'n');
  ExpectRefused(Shell(Explain(name)), 1, {name, "name too long"});
  ExpectRefused(Shell(Estimate(name)), 1, {name, "name too long"});
  ExpectRefused(Shell("\"$T\" explain " + name + " --depth-range 290:310"), 1,
                {name, "name too long"});
}

THICKLENS_SITUATION(HostileNames, APathOfMoreThan4096Bytes,
                    "The path of an input, an output file and an output folder has more than 4,096 "
                    "bytes",
                    "Refused with a message that begins with the path and has at most a page") {
  std::string path;
  for (int i = 0; i < 25; ++i) path += std::string(200, 'p') + "/";
  const std::string begin = std::string(150, 'p');
  ExpectRefused(Shell("\"$T\" explain " + path + "x --depth-range 290:310"), 1, {begin});
  ExpectRefused(Shell(Explain(path + "x")), 1, {begin});
  ExpectRefused(Shell(Estimate(path + "x")), 1, {begin});
}

THICKLENS_SITUATION(HostileNames, AWorkingFolderDeeperThanAPath,
                    "The working folder lies so deep that it has no path; inputs and outputs are "
                    "named relative to it",
                    "Done, or refused with one line; never a crash") {
  const Outcome outcome = Shell(
      "cp camera.yaml ../deep.yaml; i=0; n=$(printf 'd%.0s' $(seq 200)); while [ $i -lt 25 ]; do "
      "mkdir $n && cd -P $n || exit 98; i=$((i + 1)); done; cp \"$TMPDIR/../deep.yaml\" "
      "camera.yaml; " +
      Explain("a.json") + "; code=$?; [ $code = 0 ] && [ ! -s a.json ] && code=97; exit $code");
  if (outcome.exit_code != 0) {
    EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
    EXPECT_EQ(ErrorsIn(outcome.err).size(), 1U) << outcome.err;
  }
  Shell("rm -rf dddd*");
}

THICKLENS_SITUATION(HostileNames, AWorkingFolderThatIsGone,
                    "The working folder was removed before the start",
                    "Complete paths work; relative ones are refused with the name of the file") {
  const std::string folder = Work("gone");
  const std::string into = "mkdir gone; cd gone; rmdir ../gone; ";
  ExpectDone(Shell(into + "\"$T\" explain " + Quoted(Work("camera.yaml")) +
                   " --depth-range 290:310 --quiet --json " + Quoted(Work("a.json"))),
             {"new a.json"});
  ExpectRefused(Shell(into + "\"$T\" explain camera.yaml --depth-range 290:310"), 1,
                {"camera.yaml", "No such file"});
  ExpectRefused(Shell(into + "\"$T\" explain " + Quoted(Work("camera.yaml")) +
                      " --depth-range 290:310 --json b.json"),
                1, {"b.json"});
}

THICKLENS_SITUATION(HostileNames, AnEmptyName,
                    "A name is empty, like a shell variable that was never set",
                    "Refused as wrong usage or with the name of the option; nothing is written") {
  const std::vector<std::string> scripts = {
      Explain("''"),
      Estimate("''"),
      Render("''"),
      "\"$T\" explain '' --depth-range 290:310",
      "\"$T\" simulate image scene.yaml -o ''",
      "\"$T\" estimate picture.png depth.pfm --depth-kind z --depth-unit mm --camera '' -o new",
      "\"$T\" report lf -o new.html --truth ''",
      "\"$T\" camera init --focal-mm 50 --f-number 2 --pitch-um 5 --size 10x10 -o ''"};
  for (const std::string& script : scripts) {
    SCOPED_TRACE(script);
    const Outcome outcome = Shell(script);
    EXPECT_TRUE(outcome.exit_code == 1 || outcome.exit_code == 2) << outcome.exit_code;
    ExpectRefused(outcome, outcome.exit_code, {});
  }
}

THICKLENS_SITUATION(HostileNames, AnArgumentOfAHundredKilobytes,
                    "A name or the value of an option has 100,000 characters",
                    "Refused with a message of at most a page that names the option or begins with "
                    "the name") {
  const std::string big = "$(printf '%0100000d' 0)";
  ExpectRefused(Shell("\"$T\" explain " + big + " --depth-range 290:310"), 1, {"00000"});
  ExpectRefused(Shell(Explain(big)), 1, {"00000"});
  ExpectRefused(Shell("\"$T\" explain camera.yaml --depth-range " + big), 2,
                {"--depth-range", "00000"});
  ExpectRefused(Shell("\"$T\" explain camera.yaml --depth-range 290:310 --threads " + big + "x"), 2,
                {"--threads"});
}

}  // namespace
}  // namespace thicklens::hostile
