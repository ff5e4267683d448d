from rclzenoh.gid import gid_of

ANNOUNCED = (
    "@ros2_lv/2/1a2b3c4d/0/11/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/"
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18/::,10:,:,:,,"
)


def test_a_gid_is_the_hash_of_the_token_in_little_endian_order():
    assert gid_of(ANNOUNCED).hex() == "d5750f4532486ffa5daaffa683021e1c"
