"""MuJoCo: rigid bodies with contacts, faster than Bullet, and on Pythons that Bullet has no wheel for."""
