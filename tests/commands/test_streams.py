"""Names of files stay in their folder."""

from hypothesis import example, given, strategies as st

from gtb_cli.shell import streams


@given(
    st.text(
        st.sampled_from('a .-/\\:*?"<>|\0\n\r\t') | (st.integers(0, 0xD7FF) | st.integers(0xE000, 0x10FFFF)).map(chr)
    )
    | st.text("aé😀 .-", min_size=100, max_size=300)
)
@example("a" * (streams.MAX_STEM_BYTES - 1) + " b")
def test_file_stems_stay_in_their_folder(name):
    stem = streams.file_stem(name)
    assert stem
    assert stem[0] not in ".- "
    assert not set(stem) & set('/\\:*?"<>|\0\n\r\t')
    assert len(stem.encode("utf-8")) <= streams.MAX_STEM_BYTES
    assert streams.file_stem(stem) == stem
