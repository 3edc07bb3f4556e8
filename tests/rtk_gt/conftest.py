"""Settings of this folder's property tests."""

import hypothesis

# A busy machine is no fault of the code.
hypothesis.settings.register_profile("rtk_gt", deadline=None)
hypothesis.settings.load_profile("rtk_gt")
