"""What follows the first method while identities are uncertain: further attempts, reassignment."""
