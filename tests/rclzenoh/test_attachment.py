import pytest
import zenoh.ext

from rclzenoh.endpoint import Attachment, unpack


def test_an_attachment_is_laid_out_as_zenoh_serialises_its_parts():
    gid = bytes(range(16))
    packed = Attachment(3, 1_700_000_000_000_000_000, gid).pack()
    parts = (zenoh.ext.Int64(3), zenoh.ext.Int64(1_700_000_000_000_000_000), gid)
    assert packed == zenoh.ext.z_serialize(parts).to_bytes()
    assert unpack(zenoh.ZBytes(packed)) == (3, 1_700_000_000_000_000_000, gid)


@pytest.mark.parametrize("data", [b"", bytes(32), bytes(34), bytes(33)])
def test_an_attachment_of_another_layout_is_refused(data):
    with pytest.raises(ValueError, match="not that of a ROS 2 Jazzy node"):
        unpack(zenoh.ZBytes(data) if data else None)
