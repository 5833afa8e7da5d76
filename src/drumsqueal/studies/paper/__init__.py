"""Does the brake of Seo & Kang (2023) do what the paper says?"""
