"""MuJoCo: rigid bodies with soft contacts, several times as fast as Bullet, and on Pythons that Bullet has no wheel for."""
