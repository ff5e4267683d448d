import pytest

from throwcollect.ros.embedded.gid import gid_of, xxh3_128

# Computed with xxHash's reference implementation for bytes 0, 7, 14, … (modulo 256); each length takes another path.
KNOWN = {
    17: 0x263F67AF63088041735FE434DED90C3C,
    32: 0xA86B514658F976A5407920045A9A834C,
    33: 0xA943D80CE26ED2928B59B4DFBA3C9DE4,
    64: 0xA7FA95F7F23B64A7EDAE5E0312655703,
    65: 0xC12AAF5F8A1782A45C95500A9909A96F,
    97: 0xBC31691D04EA6EFEFEE64835DCB60271,
    128: 0xDD9E5AA9BD51CC9CC6BD21ECC865F29F,
    129: 0x433635CF8D872E7F4ACCB76587485B,
    160: 0x2282232242346EE608D4BAACCE68F2D0,
    240: 0x89E3A0A2EE355D25D10BEB4E0599E4B3,
    241: 0x75F4DA43F23CCE5A541B19226F0052E8,
    1024: 0x8BBB9F7AF37F2F52DC5ACF0B043C445B,
    1025: 0x20609DE0583FAD86E1D9CD946277AE26,
    2500: 0xEA892AD35793F07724BDCC39A1641CC5,
}


@pytest.mark.parametrize("length", KNOWN)
def test_hashes_equal_those_of_the_reference_implementation(length):
    assert xxh3_128(bytes(i * 7 % 256 for i in range(length))) == KNOWN[length]


def test_a_gid_is_the_hash_in_little_endian_order():
    announced = "@ros2_lv/0/1a2b/0/0/NN/%/%/talker"
    assert gid_of(announced) == xxh3_128(announced.encode()).to_bytes(16, "little")
    assert len(gid_of(announced)) == 16


def test_what_is_too_short_for_the_algorithm_is_refused():
    with pytest.raises(ValueError, match="at least 17 bytes, got 16"):
        xxh3_128(bytes(16))
