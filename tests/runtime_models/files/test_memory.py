"""The account of a file: what it may take, to the byte, and how a refusal is worded."""

import threading
from pathlib import Path

import pytest

from shapeshift.runtime_models.files import memory
from shapeshift.runtime_models.files.memory import A_BYTE, FREE, Account, Memory, size_of, unlimited
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import Reading

NEAR = 10 * FREE  # more than any of these takes, so that only the account's own bound counts


@pytest.fixture(autouse=True)
def usual(monkeypatch):
    """A machine of some memory, and no variable of the person who runs this."""
    monkeypatch.delenv(memory.VARIABLE, raising=False)
    monkeypatch.setattr(memory, "machine_memory", lambda: NEAR)


@pytest.mark.parametrize("size", [0, 1, 1000, FREE // A_BYTE])
def test_a_file_may_take_so_much_and_not_a_byte_more(size):
    most = A_BYTE * size + FREE
    Account(Memory(), "a", size).charge(most, "it all")
    with pytest.raises(BadFile, match="of memory"):
        Account(Memory(), "a", size).charge(most + 1, "it all")
    piecewise = Account(Memory(), "a", size)
    for _ in range(10):
        piecewise.charge(most // 10, "a part")
    piecewise.charge(most % 10, "the rest")
    with pytest.raises(BadFile, match="with one byte it would take"):
        piecewise.charge(1, "one byte")


def test_the_stated_numbers():
    """Who changes them changes docs/formats.md, and what bombs may cost."""
    assert (A_BYTE, FREE, memory.PART) == (64, 64 << 20, 0.75)
    text = (Path(__file__).parents[3] / "docs" / "formats.md").read_text()
    assert "64 bytes of memory for each of its bytes" in text and "67 MB" in text


def test_what_is_given_back_can_be_taken_again_and_lent_memory_always_is():
    account = Account(Memory(), "a", 0)
    for _ in range(3):
        with account.lend(FREE, "all"):
            pass
    with pytest.raises(KeyError), account.lend(FREE, "all"):
        raise KeyError
    account.charge(FREE, "all")
    account.release(FREE)
    account.charge(FREE, "all")
    assert account.taken == account.whole.taken == account.whole.beyond == FREE


def test_all_files_of_an_opening_share_what_is_free():
    """A thousand small bombs are no cheaper than one."""
    whole = Memory()
    accounts = [Account(whole, str(i), 1000) for i in range(4)]
    for account in accounts:
        account.charge(A_BYTE * 1000, "its own")
        account.charge(FREE // 4, "a quarter")
    with pytest.raises(BadFile):
        accounts[0].charge(1, "more")
    accounts[3].release(1)
    accounts[0].charge(1, "more")


def test_what_lies_in_a_file_counts_for_it(tmp_path):
    (tmp_path / "outer").write_bytes(bytes(10))
    (tmp_path / "inner").write_bytes(bytes(1000))
    reading = Reading().within(tmp_path / "outer")
    assert reading.within(tmp_path / "inner").memory is reading.memory
    assert reading.begun() is reading and reading.memory.size == 10
    reading.memory.widen(5)
    reading.memory.charge(A_BYTE * 15 + FREE, "all")
    with pytest.raises(BadFile):
        reading.memory.charge(1, "more")


def test_files_together_take_a_part_of_the_machine():
    whole = Memory()
    assert whole.most == NEAR * 3 // 4 and not whole.asked
    Account(whole, "a", NEAR).charge(whole.most - 1, "much")
    one = Account(whole, "b", NEAR)
    one.charge(1, "one byte")
    with pytest.raises(BadFile, match=r"^b: with another it would take 504 MB of memory, files"):
        one.charge(1, "another")


@pytest.mark.parametrize("asked", ["option", "variable"])
def test_who_asks_for_another_bound_has_that_one_alone(asked, monkeypatch):
    if asked == "variable":
        monkeypatch.setenv(memory.VARIABLE, "0.5")
    whole = Memory(0.5 if asked == "option" else 0)
    assert whole.asked and whole.most == 500_000_000
    account = Account(whole, "a.shift", 1)
    account.charge(500_000_000, "all")
    with pytest.raises(BadFile) as refusal:
        account.charge(1, "more")
    said = str(refusal.value)
    assert said.startswith("a.shift: with more it would take 501 MB of memory, files may take 500")
    assert "--memory 1 or SHAPESHIFT_MEMORY=1 (GB)" in said


def test_the_option_comes_before_the_variable(monkeypatch):
    monkeypatch.setenv(memory.VARIABLE, "4")
    assert Memory(0.25).most == 250_000_000


@pytest.mark.parametrize("text", ["much", "-1", "nan", "inf", "1 GB"])
def test_a_variable_that_is_no_number_is_refused(text, monkeypatch):
    monkeypatch.setenv(memory.VARIABLE, text)
    with pytest.raises(BadFile, match=r"SHAPESHIFT_MEMORY is .* GB is wanted"):
        Memory()


def test_the_advice_opens_the_file_and_nonsense_gets_none():
    account = Account(Memory(), "a", 100)
    with pytest.raises(BadFile, match=r"its 100 bytes may take 68 MB; .*--memory 2 or"):
        account.charge(1_100_000_000, "it")
    Account(Memory(2), "a", 100).charge(1_100_000_000, "it")
    with pytest.raises(BadFile, match="a number in it is wrong") as refusal:
        account.charge(1 << 200, "it")
    assert "--memory" not in str(refusal.value) and len(str(refusal.value)) < 200


def test_threads_charge_one_account():
    account = Account(Memory(), "a", 0)

    def work() -> None:
        for _ in range(2000):
            account.charge(3, "it")
            account.release(2)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert account.taken == account.whole.taken == account.whole.beyond == 8000


def test_a_folder_counts_with_its_files_and_not_with_links(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "a").write_bytes(bytes(10))
    (tmp_path / "in" / "b").write_bytes(bytes(5))
    assert size_of(tmp_path) == 15 and size_of(tmp_path / "a") == 10
    (tmp_path / "link").symlink_to(__file__)
    assert size_of(tmp_path) == 15


def test_this_machine_tells_what_it_has(monkeypatch):
    monkeypatch.undo()
    assert 1 << 28 < memory.machine_memory() < 1 << 50


def test_a_container_tells_what_it_may_take(monkeypatch, tmp_path):
    monkeypatch.undo()
    whole = memory.machine_memory()
    for text, wanted in (("max", whole), ("123456789", 123456789), (str(1 << 60), whole)):
        (tmp_path / "memory.max").write_text(text)
        monkeypatch.setattr(memory, "CONTROL_GROUP", tmp_path / "memory.max")
        assert memory.machine_memory() == wanted


def test_what_this_program_made_itself_is_not_bound():
    unlimited().charge(1 << 60, "anything")
